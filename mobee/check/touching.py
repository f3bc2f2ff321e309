# SPDX-License-Identifier: Apache-2.0
"""Finds links that touch at home or in every pose, and pairs never tested for contacts; writes touching pairs into an SRDF."""

from __future__ import annotations

import re
import warnings
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any, Literal

import numpy as np

from mobee.arrays import Array, Ints
from mobee.check.interface import SEED, Finding, Subject, count, length, some
from mobee.errors import InvalidValue, RobotFileError
from mobee.model.contact import Contact
from mobee.model.model import Model
from mobee.robot.load import ROBOTS, find_file, load_robot
from mobee.robot.pairs import CLUSTER, CLUSTER_REASON, joint_clusters
from mobee.robot.robot import LinkPair, Robot, Shape
from mobee.robot.urdf.srdf import find_srdf
from mobee.robot.urdf.write import disabled_and_enabled, write_disabled
from mobee.robot.xml.file import is_file
from mobee.robot.xml.node import read_xml

SAME_LINK = "on the same link, which is rigid"
SAME_PART = "fields of the same part, which overlap wherever it bends"
SINGLE = "left out singly: other shapes of these links are tested"
OTHER_ROLE = {
    "solid": "solids that an <ignore> or the rule of 2014 leaves out, while fields of these links are tested",
    "field": "fields that an <ignore> or the rule of 2014 leaves out, while solids of these links are tested",
}
UNKNOWN = "left out by an <ignore> of the file, or by the program that made the robot"


@dataclass(frozen=True, slots=True)
class UntestedGroup:
    """All pairs of shapes that are never tested for contacts for the same reason.

    `reason`: why they are not tested, with names, for example "adjacent: joint elbow". `kind`: the reason without names, for example
    "adjacent". `links`: the pairs of links, by name. `solids`, `fields`: the number of pairs of solids, and of pairs of fields (volumes
    that cause repulsive forces).
    """

    reason: str
    kind: str
    links: tuple[tuple[str, str], ...]
    solids: int
    fields: int


def untested_groups(robot: Robot) -> list[UntestedGroup]:
    """Return the pairs of the robot's shapes that are never tested for contacts, in one group for each reason, the largest group first.

    Solids are never tested against fields (volumes that cause repulsive forces) of the same robot; such pairs are not listed.
    """
    links: dict[str, set[tuple[int, int]]] = defaultdict(set)
    counts: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    pairs: dict[str, Ints] = {"solid": robot.solid_pairs, "field": robot.field_pairs}
    met = {role: {frozenset((robot.shapes[i].link, robot.shapes[j].link)) for i, j in tested} for role, tested in pairs.items()}
    for column, (role, tested) in enumerate(pairs.items()):
        done = {frozenset(pair) for pair in tested.tolist()}
        chosen = [index for index, shape in enumerate(robot.shapes) if shape.role == role]
        for i, j in combinations(chosen, 2):
            if frozenset((i, j)) not in done:
                reason = _reason(robot, i, j, met)
                low, high = sorted((robot.shapes[i].link, robot.shapes[j].link))
                links[reason].add((low, high))
                counts[reason][column] += 1
    groups = [
        UntestedGroup(reason, _kind(reason), tuple((robot.links[a], robot.links[b]) for a, b in sorted(joined)), *counts[reason])
        for reason, joined in links.items()
    ]
    return sorted(groups, key=lambda group: (-group.solids - group.fields, group.reason))


def _kind(reason: str) -> str:
    """Return a reason without names: "adjacent" for "adjacent: joint elbow"."""
    if reason.startswith("joined at"):
        return "joined at a joint or at joints that are close together"
    return re.split(r": | \(|, line ", reason, maxsplit=1)[0]


def _reason(robot: Robot, i: int, j: int, met: Mapping[str, set[LinkPair]]) -> str:
    """Return why two shapes of the same role are not tested for contacts.

    `i`, `j`: numbers of the shapes. `met`: for each role ("solid" or "field"), the pairs of links between which at least one pair of shapes
    is tested.
    """
    one, other = robot.shapes[i], robot.shapes[j]
    links = frozenset((one.link, other.link))
    if one.link == other.link:
        return SAME_LINK
    if links in robot.untested:
        return robot.untested[links]
    if links in met[one.role]:
        return SINGLE
    if one.role == "field" and one.part == other.part:
        return SAME_PART
    return OTHER_ROLE[one.role] if any(links in tested for tested in met.values()) else UNKNOWN


POSES = 10_000  # random; a pair that touches in all of them counts as always touching
CHUNK = 500  # poses in one evaluation

LinkNames = tuple[str, str]


@dataclass(frozen=True, slots=True)
class TouchingPair:
    """Two links whose solids touch.

    `first`, `second`: names of the links; for a URDF, the names in the file (`load_robot` merges links that a fixed joint connects, and
    these names are those before the merge). `reason`: "Always": they touch in all random poses; "Default": they touch at home (the words of
    MoveIt). `depth`: m, of the deepest contact at home, 0 if they do not touch there. `share`: the fraction of the random poses in which
    they touch.
    """

    first: str
    second: str
    reason: Literal["Default", "Always"]
    depth: float
    share: float


def touching_pairs(robot: Robot, poses: int = POSES) -> tuple[TouchingPair, ...]:
    """Return the pairs of links whose solids touch at home or in all random poses, the pairs that always touch first.

    `poses`: number of random poses, which have a fixed seed. Fields and objects of a world are not tested.
    """
    if poses < 1:
        raise InvalidValue(f"poses={poses!r}: give at least 1")
    subject = Subject(replace(robot, field_pairs=robot.field_pairs[:0]))
    model = Model(subject.limited)
    names = {(i, j): _links(subject, i, j) for i, j in map(sorted, robot.solid_pairs.tolist())}
    depth: dict[LinkNames, float] = {}
    index = {shape.name: number for number, shape in enumerate(robot.shapes)}
    for contact in model.evaluate(subject.home).contacts:
        first, second = sorted((index[contact.first], index[contact.second]))
        pair = names[first, second]
        depth[pair] = max(depth.get(pair, 0.0), contact.depth)
    times: dict[LinkNames, int] = defaultdict(int)
    rng, (low, high) = np.random.default_rng(SEED), subject.range.T
    for start in range(0, poses, CHUNK):
        batch = rng.uniform(low, np.maximum(high, low), (min(CHUNK, poses - start), len(low)))
        for pair, more in _counted(model, batch, names).items():
            times[pair] += more
    found = [
        TouchingPair(*pair, "Always" if times[pair] == poses else "Default", depth.get(pair, 0.0), times[pair] / poses)
        for pair in {*depth, *(pair for pair, count in times.items() if count == poses)}
    ]
    return tuple(sorted(found, key=lambda pair: (pair.reason, -pair.share, pair.first, pair.second)))


def _counted(model: Model, poses: Array, names: dict[tuple[int, int], LinkNames]) -> dict[LinkNames, int]:
    """Return in how many of the poses (k, n) each pair of links touches."""
    numbers = model.evaluate(poses).table.numbers
    seen: dict[LinkNames, set[int]] = defaultdict(set)
    for pose, first, second in numbers[:, [0, 2, 3]].tolist():
        seen[names[min(first, second), max(first, second)]].add(pose)
    return {pair: len(touching) for pair, touching in seen.items()}


def _links(subject: Subject, first: int, second: int) -> LinkNames:
    shapes, links = subject.robot.shapes, subject.robot.links
    one, other = (subject.urdf_link(shapes[i].name) or links[shapes[i].link] for i in (first, second))
    return (one, other) if one < other else (other, one)


def always_touching(subject: Subject) -> Iterator[Finding]:
    """Yield a finding for each pair of shapes that overlaps at home and in every sampled pose."""
    for first, second, kind in sorted(subject.always):
        yield Finding(
            "warning",
            "always-touching",
            subject.where("shape", first),
            f"{kind}s {first!r} and {second!r} overlap in every sampled pose",
            "their contact carries no information, and its force never ends"
            if kind == "field"
            else "every pose counts as a collision, so no plan is ever valid",
            f"make one smaller, or leave the pair out: {_ignoring(subject, first, second)}{_written(subject) if kind == 'solid' else ''}",
        )


def _written(subject: Subject) -> str:
    """Return a hint that names the option which writes these <disable_collisions> lines; for a URDF only."""
    return " (--write-srdf writes it)" if subject.is_urdf("robot", subject.robot.name) else ""


def _ignoring(subject: Subject, first: str, second: str) -> str:
    """Return the line of XML that excludes the pair of links of two shapes."""
    link1, link2 = subject.urdf_link(first), subject.urdf_link(second)
    file1, file2 = (subject.where("shape", shape).rpartition(":")[0] for shape in (first, second))
    if link1 and link2 and file1 == file2:
        return f'<disable_collisions link1="{link1}" link2="{link2}" reason="Default"/> in the SRDF beside it'
    links = {shape.name: subject.robot.links[shape.link] for shape in subject.robot.shapes}
    if subject.is_mjcf:
        return f'<exclude body1="{links[first]}" body2="{links[second]}"/> in <contact>'
    return f'<ignore first="{links[first]}" second="{links[second]}"/>'


def home_contacts(subject: Subject) -> Iterator[Finding]:
    """Yield a finding for each contact of solids or of fields at home, including contacts with the world.

    Fields are volumes that cause repulsive forces. Pairs that overlap in every sampled pose are left out, since `always_touching` reports
    them.
    """
    world = subject.world.objects if subject.world else {}
    for contact in subject.at_home:
        if (contact.first, contact.second, contact.kind) in subject.always:
            continue
        pair = f"{contact.first!r} and {contact.second!r}{' of the world' if contact.second in world else ''}"
        if contact.kind == "solid":
            yield Finding(
                "error",
                "home-collision",
                subject.where("shape", contact.first),
                f"at home {pair} collide, {length(contact.depth)} deep",
                "the robot starts in a collision that it could not have moved into",
                _parting(subject, contact),
            )
        else:
            yield Finding(
                "warning",
                "home-force",
                subject.where("shape", contact.first),
                f"at home fields {pair} overlap by {length(contact.depth)}"
                if contact.second not in world
                else f"at home field {pair} overlap by {length(contact.depth)}",
                "the force pushes the robot away from its home from the first tick on",
                "make a field smaller, or move the home",
            )


def world_contacts(subject: Subject) -> Iterator[Finding]:
    """Yield one note with the contacts of the robot's solids and fields with objects of the world at home; no finding without a world.

    Fields are volumes that cause repulsive forces.
    """
    if subject.world is None:
        return
    world = subject.world.objects
    touched = [contact for contact in subject.at_home if contact.second in world]
    pairs = (f"{contact.kind} {contact.first!r} and {contact.second!r} ({length(contact.depth)})" for contact in touched)
    yield Finding(
        "note",
        "world",
        subject.where("robot", subject.robot.name),
        f"at home in this world of {count(world, 'object')} the robot touches {some(pairs) or 'nothing'}",
        "",
        "",
    )


def _parting(subject: Subject, contact: Contact) -> str:
    """Return the remedy for two solids that collide at home."""
    if subject.is_mjcf:
        remedy = 'write a <key name="home" qpos="..."/> without contact, or correct a shape'
        apart = "" if contact.second_link < 0 else f"; where only hulls overlap: {_ignoring(subject, contact.first, contact.second)}"
        return remedy + apart
    if not subject.is_urdf("shape", contact.first):
        return "move the home, make a shape smaller, or correct where one is placed"
    remedy = 'choose a home: <group_state name="home"> in the SRDF beside it (else 0, or the nearest limit), or correct a shape'
    if contact.second_link < 0:
        return remedy
    return f"{remedy}; where only hulls of meshes overlap: {_ignoring(subject, contact.first, contact.second)}{_written(subject)}"


LONG = 0.15  # m: the shoulder, wrist or hand of a large robot is shorter


def long_clusters(subject: Subject) -> Iterator[Finding]:
    """Yield a finding for each long cluster of joints: the links that its first and last joint move are not tested."""
    robot, joints = subject.robot, subject.robot.joints
    for cluster in joint_clusters(joints):
        points = np.array([joints[k].point for k in cluster])
        span = float(np.linalg.norm(points[:, None] - points, axis=2).max())
        outer = frozenset((cluster[0] + 1, cluster[-1] + 1))
        if span > LONG and robot.untested.get(outer, "").startswith(CLUSTER_REASON):
            yield Finding(
                "warning",
                "long-cluster",
                subject.where("joint", joints[cluster[0]].name),
                f"{count(cluster, 'joint')} from {joints[cluster[0]].name!r} on are one cluster, {length(span)} long",
                f"joints less than {length(CLUSTER)} apart count as one place: the links around them are never tested against each other, "
                "also where they can touch",
                "`mobee convert IN OUT.xml` writes a file that lists these pairs as <ignore>: remove the lines of pairs that can touch",
            )


def foreign_solids(subject: Subject) -> Iterator[Finding]:
    """Yield notes about fields that overlap a solid of another part in the home pose, but cause no repulsive force there.

    Fields are volumes around the solids of links. A repulsive force acts only if two fields overlap. So there is no force if the field
    has no contact with a field of the link to which the solid belongs. There is one note for each pair (part of the field, part of the
    solid), about the deepest overlap.
    """
    deepest: dict[tuple[str, str], tuple[Shape, Shape, float]] = {}
    for field, solid, depth in subject.foreign:
        parts = field.part, solid.part
        if parts not in deepest or depth > deepest[parts][2]:
            deepest[parts] = field, solid, depth
    for (part, other), (field, solid, depth) in sorted(deepest.items()):
        yield Finding(
            "note",
            "foreign-solid",
            subject.where("shape", field.name),
            f"at home field {field.name!r} of part {part!r} reaches {length(depth)} into solid {solid.name!r} of {other!r}",
            f"fields act on fields only: {part} comes this near without any force",
            f"nothing, if the limits keep them apart; else test the fields of {subject.robot.links[solid.link]!r} against those of "
            f"{subject.robot.links[field.link]!r} (`mobee check --pairs` says why they are not)"
            if _left_out(subject, field.link, solid.link)
            else f"give the link of {solid.name!r} a field that encloses it, or make {field.name!r} smaller",
        )


def _left_out(subject: Subject, one: int, other: int) -> bool:
    """Return whether both links have fields, and these are never tested against each other."""
    shapes, links = subject.robot.shapes, {one, other}
    bearing = {shape.link for shape in shapes if shape.role == "field"}
    return links <= bearing and not any({shapes[i].link, shapes[j].link} == links for i, j in subject.robot.field_pairs)


@dataclass(frozen=True, slots=True)
class LeftOut:
    """The result of `leave_out_touching`.

    `path`: path of the SRDF file. `merged`: True: the pairs were added to the text of an existing SRDF; False: the file is new. `pairs`:
    the pairs that were added. `enabled`: the touching pairs that were not added, because the SRDF explicitly enables their test.
    `touching`: number of contacts of solids that remain at home when the robot is read with the new file. `found`: whether `load_robot`
    finds the file if it is not given its path.
    """

    path: Path
    merged: bool
    pairs: tuple[TouchingPair, ...]
    enabled: tuple[TouchingPair, ...]
    touching: int
    found: bool


def leave_out_touching(urdf: str | Path, out: Path | None = None, **options: Any) -> LeftOut:
    """Write <disable_collisions> into an SRDF for every two links of a URDF whose solids touch at home or in all random poses.

    `out`: path of the SRDF; None: the SRDF that `load_robot` reads with this URDF, or a new one beside the URDF. The text of an existing
    SRDF is kept, and lines are added to it. The file is written completely or not at all. `options`: keyword arguments of `load_robot`.

    Raises:
        RobotFileError: the URDF or SRDF cannot be read, the SRDF cannot be written, or several links of the URDF are in one line.
        UnknownName: `urdf` is a name without a folder and suffix, and no robot has this name.
        InvalidValue: `urdf` is not a URDF, or an option is not valid; or the name of the SRDF to be written does not end in .srdf; or
            `out` exists already, and the option `srdf` names another SRDF.
    """
    path = find_file(urdf, ROBOTS, "robot")
    if path.suffix.lower() != ".urdf":
        raise InvalidValue(f"{path} is no URDF: in zero-position XML <ignore first= second=> leaves out a pair. Leave out --write-srdf.")
    used = _used(path, options.get("srdf"))
    target = _target(path, out, used, options.get("srdf"))
    base = target if is_file(target) else used
    robot = _read(path, options, base)
    _require_links(robot, path)
    disabled, enabled = disabled_and_enabled(base) if base is not None else (set(), set())
    touching = [pair for pair in touching_pairs(robot) if frozenset((pair.first, pair.second)) not in disabled]
    new = tuple(pair for pair in touching if frozenset((pair.first, pair.second)) not in enabled)
    if new or not is_file(target):
        write_disabled(target, base, robot.name, ((pair.first, pair.second, pair.reason) for pair in new))
    again = _read(path, options, target)
    left = sum(contact.kind == "solid" for contact in Model(again).evaluate(again.home).contacts)
    wanted = tuple(pair for pair in touching if pair not in new)
    return LeftOut(target, base is not None, new, wanted, left, _is_found(path, target))


def _read(path: Path, options: dict[str, Any], srdf: Path | None) -> Robot:
    """Return the robot, without the reader's warnings: the check reports them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return load_robot(path, **options | {"srdf": srdf})


def _used(path: Path, srdf: str | Path | None) -> Path | None:
    """Return the SRDF that `load_robot` reads."""
    if srdf is not None:
        return Path(srdf)
    root = read_xml(path)
    return find_srdf(path, root.optional("name") or path.stem)


def _is_found(path: Path, srdf: Path) -> bool:
    found = _used(path, None)
    return found is not None and found.resolve() == srdf.resolve()


def _target(path: Path, out: Path | None, used: Path | None, srdf: str | Path | None) -> Path:
    target = out or used or path.with_suffix(".srdf")
    if target.suffix.lower() != ".srdf":
        raise InvalidValue(f"{target} is not the name of an SRDF. Give one that ends in .srdf.")
    if srdf is not None and is_file(target) and target.resolve() != Path(srdf).resolve():
        raise InvalidValue(
            f"{target} is there already, and the robot is read with {srdf}. Read it with --srdf {target}, or name a new file."
        )
    return target


def _require_links(robot: Robot, path: Path) -> None:
    """Raise RobotFileError if several links of the URDF are on one line of the file.

    The line number is the only record of which link a shape belongs to.
    """
    subject = Subject(robot)
    unknown = next((shape for shape in robot.shapes if subject.urdf_link(shape.name) is None), None)
    if unknown is not None:
        line = subject.where("shape", unknown.name)
        raise RobotFileError(f"{line}: several links are in this line. Put each on lines of its own: xmllint --format {path.name}")
