"""Which fields of a robot without parts are tested against each other.

Fields of one part never are, for they overlap wherever the part bends; but where nobody has divided a robot into parts, one hand
would never feel the other. So there fields are tested whose links are more than two joints apart and which do not meet as drawn
(fingers side by side): each is taken for the capsule around it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mobee.robot.robot import Array, Ints, Joint, Shape

BENT = 2  # joints between links whose fields overlap wherever they bend


def far_apart(joints: Sequence[Joint], fields: Sequence[Shape]) -> NDArray[np.bool_]:
    """Table (k, k): which of the fields are more than two joints apart and do not meet with every joint at zero."""
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
    """Joints on the way from each link to each other, (links, links)."""
    between = np.zeros((len(joints) + 1,) * 2, dtype=np.intp)
    for index, joint in enumerate(joints):  # parents come first
        between[index + 1, : index + 1] = between[: index + 1, index + 1] = between[joint.parent, : index + 1] + 1
    return between


def _capsule(shape: Shape) -> tuple[Array, float]:
    """Half the axis (3,) m, root frame, and the radius of a capsule about a shape's position that holds the shape."""
    if shape.kind == "box":
        longest = int(np.argmax(shape.size))
        across = np.delete(np.array(shape.size), longest)
        return shape.size[longest] / 2.0 * shape.rotation[:, longest], float(np.linalg.norm(across)) / 2.0
    if shape.vertices is not None:
        return np.zeros(3), float(np.linalg.norm(shape.vertices, axis=1).max())
    half = shape.size[1] / 2.0 if len(shape.size) > 1 else 0.0  # of a cylinder or capsule; a sphere has none
    return half * shape.rotation[:, 2], shape.size[0]


def segment_distances(offsets: Array, along: Array, across: Array) -> Array:
    """Distances (k,) m of a segment from others: its half axis (3,), theirs (k, 3), `offsets` (k, 3) from their centres to its own.

    Either the nearest points are inside of both segments, or one of them is an end.
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
