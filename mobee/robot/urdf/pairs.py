# SPDX-License-Identifier: Apache-2.0
"""The pairs of shapes (solids, and the fields generated around them) of a robot from a URDF that are tested for contacts.

Two shapes on different links are tested, except
- shapes of adjacent links, unless the SRDF enables them. Links are adjacent if one joint connects them, or a chain of joints at one place
  (within 5 cm, and no slide of a longer range), such as a wrist that is written as three joints, if the links between have no solid
  (`adjacent_links`);
- shapes of links (of the URDF, before fixed joints are merged) whose tests the SRDF disables;
- fields of one part. But if the SRDF does not define the parts, fields of one part that are far apart are tested (`far_apart`).

Without an SRDF no other pairs are left out; `mobee check` reports shapes that overlap in every pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.robot.pairs import CLUSTER, slides_far
from mobee.robot.robot import Joint, LinkPair, Shape
from mobee.robot.urdf.srdf import NamePair, Srdf

MOST_BETWEEN = 6  # joints at one place: a rigid body has six degrees of freedom
OwnFields = Literal["none", "far apart", "all"]


@dataclass(frozen=True, slots=True, eq=False)
class PairRules:
    """Rules for the pairs of links whose contacts are not computed, and for the fields of one part that are tested with each other.

    Fields are volumes that cause repulsive forces. `links`: dict from the name of a URDF link to the index of the robot's link. `adjacent`:
    pairs of adjacent links (indices), each with the reason. `srdf`: the content of the SRDF file, with its disabled and enabled pairs.
    `own`: which fields of one part are tested with each other: "none", "far apart" (`mobee.robot.urdf.pairs.far_apart`) or "all".
    """

    links: dict[str, int]
    adjacent: dict[LinkPair, str]
    srdf: Srdf
    own: OwnFields = "none"


def adjacent_links(joints: Sequence[Joint], shapes: Sequence[Shape]) -> dict[LinkPair, str]:
    """Return the pairs of adjacent links (indices), each with the reason as text.

    Two links are adjacent if one joint connects them. They are adjacent too if a chain of at most six joints connects them, all joints are
    within 5 cm of the last one, none of them slides by more than 5 cm, and the links between have no solid. `joints`, with their limits,
    `shapes`: of the robot.
    """
    solid = {shape.link for shape in shapes if shape.role == "solid"}
    found: dict[LinkPair, str] = {}
    for index, joint in enumerate(joints):
        found[frozenset((joint.parent, index + 1))] = f"adjacent: joint {joint.name}"
        link, between = joint.parent, 1
        while (
            0 < link
            and link not in solid
            and not slides_far(joint)
            and not slides_far(joints[link - 1])
            and between < MOST_BETWEEN
            and float(np.linalg.norm(joints[link - 1].point - joint.point)) < CLUSTER
        ):
            first = joints[link - 1]
            link, between = first.parent, between + 1
            found[frozenset((link, index + 1))] = f"adjacent: joints {first.name} to {joint.name} at one place"
    return found


def shape_pairs(joints: Sequence[Joint], shapes: Sequence[Shape], owners: Sequence[str], role: str, rules: PairRules) -> Ints:
    """Return the pairs of shapes of one role ("solid" or "field") that are tested for contacts, (p, 2), indices in `shapes`.

    A field is a volume that causes a repulsive force. `joints`, `shapes`: of the robot. `owners`: for each shape the name of its URDF link.
    `rules`: the pairs of links and the fields that are not tested.
    """
    chosen = np.array([index for index, shape in enumerate(shapes) if shape.role == role], dtype=np.intp)
    names = {name: k for k, name in enumerate(rules.links)}
    owner = np.array([names[owners[index]] for index in chosen], dtype=np.intp)
    link = np.array([shapes[index].link for index in chosen], dtype=np.intp)
    disabled = _matrix(rules.srdf.disabled, names)
    near = np.zeros((max(rules.links.values()) + 1,) * 2, dtype=bool)
    for a, b in map(tuple, rules.adjacent):
        near[a, b] = near[b, a] = True
    tested = (link[:, None] != link) & ~disabled[owner[:, None], owner]
    tested &= ~near[link[:, None], link] | _matrix(rules.srdf.enabled, names)[owner[:, None], owner]
    if role == "field" and rules.own != "all":
        parts = {shape.part: k for k, shape in enumerate(shapes)}
        part = np.array([parts[shapes[index].part] for index in chosen], dtype=np.intp)
        others = part[:, None] != part
        tested &= others if rules.own == "none" else others | far_apart(joints, [shapes[index] for index in chosen])
    return chosen[np.argwhere(np.triu(tested, 1))]


def _matrix(pairs: dict[NamePair, str] | set[NamePair], names: dict[str, int]) -> NDArray[np.bool_]:
    table = np.zeros((len(names), len(names)), dtype=bool)
    for a, b in map(tuple, pairs):
        table[names[a], names[b]] = table[names[b], names[a]] = True
    return table


def untested_links(shapes: Sequence[Shape], solid_pairs: Ints, rules: PairRules) -> dict[LinkPair, str]:
    """Return the pairs of links (indices) that are never tested for contacts, each with the reason.

    `solid_pairs`: (p, 2) indices in `shapes`, the tested pairs of solids.
    """
    enabled = {frozenset(rules.links[name] for name in pair) for pair in rules.srdf.enabled}
    tested = {frozenset((shapes[i].link, shapes[j].link)) for i, j in solid_pairs.tolist()}
    untested = {pair: reason for pair, reason in rules.adjacent.items() if pair not in enabled}
    for names, reason in rules.srdf.disabled.items():
        pair = frozenset(rules.links[name] for name in names)
        if len(pair) == 2 and pair not in tested:
            untested.setdefault(pair, reason)
    return untested


BENT = 2  # joints between links whose fields overlap wherever they bend


def far_apart(joints: Sequence[Joint], fields: Sequence[Shape]) -> NDArray[np.bool_]:
    """Return a table (k, k) of booleans: whether two fields are far apart.

    Two fields are far apart if more than two joints lie between their links, and the fields (as enclosing capsules) do not touch while
    every joint is at zero.
    """
    link = np.array([field.link for field in fields], dtype=np.intp)
    far: NDArray[np.bool_] = (_joints_between(joints) > BENT)[link[:, None], link]
    half_axes, radii = np.zeros((len(fields), 3)), np.zeros(len(fields))
    for k, field in enumerate(fields):
        half_axes[k], radii[k] = _capsule(field)
    centres = np.array([field.position for field in fields]).reshape(-1, 3)
    for k in range(len(fields)):
        others = np.flatnonzero(far[k])
        distance = segment_distances(centres[k] - centres[others], half_axes[k], half_axes[others])
        far[k, others] = distance >= radii[k] + radii[others]
    return far


def _joints_between(joints: Sequence[Joint]) -> Ints:
    """Return the number of joints on the path from each link to each other link, (links, links)."""
    between = np.zeros((len(joints) + 1,) * 2, dtype=np.intp)
    for index, joint in enumerate(joints):  # parents come first
        between[index + 1, : index + 1] = between[: index + 1, index + 1] = between[joint.parent, : index + 1] + 1
    return between


def _capsule(shape: Shape) -> tuple[Array, float]:
    """Return half the axis (3,) m, root frame, and the radius of a capsule, centred at a shape's position, that contains the shape."""
    if shape.kind == "box":
        longest = int(np.argmax(shape.size))
        across = np.delete(np.array(shape.size), longest)
        return shape.size[longest] / 2.0 * shape.rotation[:, longest], float(np.linalg.norm(across)) / 2.0
    if shape.vertices is not None:
        return np.zeros(3), float(np.linalg.norm(shape.vertices, axis=1).max())
    half = shape.size[1] / 2.0 if len(shape.size) > 1 else 0.0  # of a cylinder or capsule; a sphere has none
    return half * shape.rotation[:, 2], shape.size[0]


def segment_distances(offsets: Array, along: Array, across: Array) -> Array:
    """Return the distances (k,) m of one line segment from k other segments.

    `along` (3,): half axis of the one segment, from its centre to an end. `across` (k, 3): half axes of the others. `offsets` (k, 3): from
    the centres of the others to the centre of the one. All in m. Method: the nearest points are either inside both segments, or one of
    them is an end of its segment.
    """
    a, b, c = along @ along, across @ along, (across**2).sum(axis=1)
    d, e = offsets @ along, (offsets * across).sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):  # parallel ones, and those that are points
        ends = [(np.full(len(b), s), np.clip((e + s * b) / c, -1.0, 1.0)) for s in (-1.0, 1.0)]
        ends += [(np.clip((t * b - d) / a, -1.0, 1.0), np.full(len(b), t)) for t in (-1.0, 1.0)]
        shares = np.array([*ends, ((b * e - c * d) / (a * c - b**2), (a * e - b * d) / (a * c - b**2))])  # (5, 2, k)
    shares[4, :, ~(np.abs(shares[4]).max(axis=0) <= 1.0)] = 0.0
    s, t = np.nan_to_num(shares).transpose(1, 0, 2)[..., None]
    gaps = offsets + s * along - t * across
    nearest: Array = np.linalg.norm(gaps, axis=2).min(axis=0)
    return nearest
