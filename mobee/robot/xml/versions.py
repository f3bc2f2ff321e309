# SPDX-License-Identifier: Apache-2.0
"""Rewrites files of older versions into today's grammar before they are read.

| version attribute of the root | form |
| --- | --- |
| 2.0 | today's (mobee/robot/robots/README.md) |
| 0.1 | MoBeE 0.1 |
| 1.0, or none | the programs of 2010 to 2014; or MoBeE 0.1, which wrote 1.0 too, if the file has a tag or attribute that was new in 0.1 |

MoBeE 0.1 differs from today in three rules: elements inside a <link> were placed relative to the link's end; a box was turned by the
smallest rotation that takes its y axis to the height axis (hx, hy, hz); and a marker without a normal had +z. original.py rewrites robot
files of the older programs and lists their differences. World files of VirtualSkin and MoBeE of 2011 to 2014 have the root element
<WorldList>; `rewrite_world_list` makes a <World> of it.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mobee.arrays import Array
from mobee.errors import OlderVersion
from mobee.robot.writing import degrees, number, numbers
from mobee.robot.xml.node import VERSION, Node, Remark, descendants, shown
from mobee.robot.xml.original import VOLUMES, at_line, find_evidence, free_name, rewrite_original, vector_texts
from mobee.robot.xml.volume import (
    AXIS,
    PLACE,
    UPRIGHT,
    VOLUME_TAGS,
    Y,
    align,
    direction,
    height_along,
    height_and_angle,
    link_step,
    turn_about,
)

Version = Literal["2.0", "1.0", "0.1"]
WORLD_TAGS = ("world", "worldlist")
NORMAL = ("nx", "ny", "nz")
ATTACHED = frozenset({*VOLUME_TAGS, "convex", "marker", "mass"})
CONVERT = "`mobee convert OLD.xml NEW.xml` writes today's form"

# What only MoBeE 0.1 read, by tag. A tag without attributes is new itself.
_OF_0_1: dict[str, frozenset[str]] = {
    "zeropositionkinematictree": frozenset({"adjacency"}),
    "link": frozenset({"name", "base"}),
    "joint": frozenset({"name", "moves", "motor", "base"}),
    "motor": frozenset({"velocity", "acceleration", "torque"}),
    "marker": frozenset({*PLACE, "rotation"}),
    "sphere": frozenset({"name", "base"}),
    "cylinder": frozenset({"name", "base"}),
    "box": frozenset({"name", "base"}),
}
_TAGS_OF_0_1 = frozenset({"capsule", "convex", "mass", "ignore", "robot"})
LOWEST = 1e-6  # m; a shorter height axis counts as none, as in Qt


@dataclass(frozen=True, slots=True)
class _Change:
    """An element that MoBeE 0.1 reads differently from today's program.

    `rule`: the rule of 0.1 in words. `attributes`: attributes of today's grammar that give the element the meaning that it had in 0.1.
    """

    node: Node
    rule: str
    attributes: dict[str, str]


def upgrade_robot(root: Node) -> list[Remark]:
    """Rewrite the elements of a robot file of any version into today's grammar, in place; return remarks for the user on the changes.

    `root`: the root element. Raises RobotFileError for an unknown version. Faults that `mobee.robot.xml.node.read_xml` repaired
    (`root.repairs`) are accepted only in a file of 2010 to 2014; in other files they raise RobotFileError.
    """
    version, remarks, is_certain = _version(root)
    if version == "1.0":
        remarks = rewrite_original(root) + remarks
        remarks += [] if is_certain else _ambiguous(root)
    else:
        _refuse_repairs(root)
        if version == "0.1":
            remarks += _rewrite_0_1(root)
    root.attributes["version"] = VERSION
    return remarks


def upgrade_world(root: Node) -> list[Remark]:
    """Rewrite the elements of a world file of any version into today's grammar, in place; return remarks for the user on the changes.

    `root`: the root element. Raises RobotFileError for an unknown version. Faults that `mobee.robot.xml.node.read_xml` repaired
    (`root.repairs`) are accepted only in a <WorldList> of 2011 to 2014; in other files they raise RobotFileError.
    """
    if root.tag == "worldlist":
        remarks = rewrite_world_list(root)
    else:
        given = root.optional("version")
        _refuse_repairs(root)
        root.choice("version", given or "1.0", (VERSION, "1.0", "0.1"), "version")
        remarks = [] if given == VERSION else _rewrite_0_1(root)
    root.attributes["version"] = VERSION
    return remarks


def _version(root: Node) -> tuple[Version, list[Remark], bool]:
    """Return the version of a robot file, the remark with the reason, and whether that is certain."""
    given = root.optional("version")
    if given in (VERSION, "0.1"):
        return ("2.0" if given == VERSION else "0.1"), [], True
    if given not in ("", "1.0"):
        root.fail(
            "version", f"{shown(given)!r} is not known", f'Write version="{VERSION}" for today\'s grammar. Valid: 0.1, 1.0, {VERSION}'
        )
    original = find_evidence(root)
    if original is not None and original.certain:
        return "1.0", [original.remark()], True
    of_0_1 = next(_extensions(root), None)
    if of_0_1 is not None:
        return "0.1", [Remark(root, f"read as MoBeE 0.1 wrote it, for {of_0_1} is of that version", CONVERT, "note")], True
    return "1.0", [] if original is None else [original.remark()], False


def _extensions(root: Node) -> Iterator[str]:
    """Yield the tags and attributes of a file that MoBeE 0.1 introduced, for example "<joint motor=> in line 7"."""
    for node in descendants(root):
        if node.tag in _TAGS_OF_0_1:
            yield f"<{node.tag}> in line {node.line}"
        for name in sorted(_OF_0_1.get(node.tag, frozenset()) & node.attributes.keys()):
            yield f"<{node.tag} {name}=> in line {node.line}"
        if node.tag == "joint" and not {"minPos", "maxPos"} & node.attributes.keys():
            yield f"a <joint> without limits in line {node.line}"
        if node.tag == "constraint" and re.search("[a-z_]", node.attributes.get("q", ""), re.IGNORECASE):
            yield f"a <constraint> that names motors in line {node.line}"


def _refuse_repairs(root: Node) -> None:
    """Raise the error of the first fault in the XML file that `read_xml` has repaired, if there is one.

    Only the programs of 2010 to 2014 accepted such faults, for example an attribute that is given twice.
    """
    if root.repairs:
        raise root.repairs[0].error


def _rewrite_0_1(root: Node) -> list[Remark]:
    """Rewrite attributes of MoBeE 0.1 into today's grammar; one warning for each rule that made a difference."""
    if root.attributes.get("adjacency") == "published_2014":
        root.attributes["adjacency"] = "recorded_2014"  # what MoBeE 0.1 took for it
    rules: dict[str, list[_Change]] = {}
    for change in list(_changes(root)):
        rules.setdefault(change.rule, []).append(change)
        for name in AXIS if "angle" in change.attributes else ():
            change.node.attributes.pop(name, None)
        change.node.attributes.update(change.attributes)
    return [Remark(mine[0].node, f"read as MoBeE 0.1 read it: {rule} ({_times(mine)})", CONVERT) for rule, mine in rules.items()]


def _ambiguous(root: Node) -> list[Remark]:
    """Return the warnings for a file that MoBeE 0.1 could also read, but read differently."""
    rules: dict[str, list[_Change]] = {}
    for change in _changes(root):
        rules.setdefault(change.rule, []).append(change)
    remedy = f'Write version="{VERSION}" into the root if this is meant, version="0.1" if not'
    return [
        Remark(mine[0].node, f"read as the programs of 2010 to 2014 read it. MoBeE 0.1 differed: {rule} ({_times(mine)})", remedy)
        for rule, mine in rules.items()
    ]


def _times(changes: list[_Change]) -> str:
    return "here" if len(changes) == 1 else f"{len(changes)} times, first here"


def _changes(root: Node) -> Iterator[_Change]:
    """Yield a change for each element that MoBeE 0.1 and today's grammar read differently, with the rule of 0.1.

    The attribute `points` of every <convex> must have three numbers for each point.
    """
    waiting: list[tuple[Node, Array]] = [(root, np.zeros(3))]
    while waiting:
        node, step = waiting.pop()
        if node.tag in ATTACHED and step.any():
            place = node.vector(PLACE) + step
            yield _Change(node, "what stands inside a <link> stands at its end", dict(zip(PLACE, map(number, place), strict=True)))
        if node.tag in ("box", "convex"):
            yield from _turned(node)
        if node.tag == "marker" and not {*NORMAL, "rotation"} & node.attributes.keys():
            yield _Change(node, "a marker without a normal has +z", {"nz": "1"})
        inside = link_step(node)[0] if node.tag == "link" else np.zeros(3) if node.tag == "joint" else step
        waiting += [(child, inside) for child in reversed(node.children)]


def _turned(node: Node) -> Iterator[_Change]:
    if node.tag == "convex" and len(node.numbers("points")) % 3:
        return  # `mobee.robot.xml.body.read_convex` refuses it with its line
    axis, angle = direction(node, AXIS, (0.0, 1.0, 0.0)), np.deg2rad(node.number("angle", 0.0))
    rotation = turn_about(axis, angle) @ align(Y, axis)
    if np.abs(rotation - height_along(axis, angle)).max() <= 1e-12:
        return
    if node.tag == "box":
        axis, angle = height_and_angle(rotation)
        texts = dict(zip(AXIS, map(number, axis), strict=True)) | {"angle": degrees(angle)}
    else:  # a hull is not symmetric: its points are written unchanged
        texts = {"points": numbers((np.array(node.numbers("points")).reshape(-1, 3) @ rotation.T).reshape(-1)), "angle": "0"}
    yield _Change(node, f"a <{node.tag}> turns the shortest way to its height axis", texts)


def report(remarks: list[Remark]) -> None:
    """Issue a warning (`OlderVersion`) for each remark of severity "warning"; remarks of severity "note" are left out."""
    for remark in remarks:
        if remark.severity == "warning":
            remark.node.warn(f"{remark.what}. {remark.remedy}" if remark.remedy else remark.what, OlderVersion)


def rewrite_world_list(root: Node) -> list[Remark]:
    """Rewrite a <WorldList> of 2011 to 2014 into a <World>, in place; return remarks for the user on the interpretation.

    An object of a <WorldList> has a frame, and volumes whose poses are relative to this frame; in a <World> each volume is an object. If an
    object has one volume, the volume gets the object's name; if it has several, each gets the name with a number appended. Colours of 0 to
    255 are converted. A target exerted no force in 2014; here it repels all links except the hand that reaches for it.
    """
    remarks = [Remark(root, "read as a world of VirtualSkin or MoBeE, 2011 to 2014: <WorldList>", severity="note")]
    remarks += [Remark(at_line(root, repair.line), repair.what, repair.remedy) for repair in root.repairs]
    volumes: list[Node] = []
    taken: Counter[str] = Counter()
    for index, node in enumerate(root.children, start=1):
        if node.tag != "object":
            remarks.append(Remark(node, "unknown tag is ignored with all inside"))
            continue
        mine = [child for child in node if child.tag in VOLUMES]
        remarks += [Remark(child, "unknown tag is ignored with all inside") for child in node if child.tag not in VOLUMES]
        if not mine:
            remarks.append(Remark(node, "the object holds no volume and is ignored", "Put a <sphere>, <cylinder> or <box> into it"))
        given = node.optional("name") or f"object{index}"
        for number_of, child in enumerate(mine, start=1):
            name = given if len(mine) == 1 else f"{given}_{number_of}"
            taken[name] += 1
            if taken[name] > 1:
                remarks.append(
                    Remark(child, f"a second object {shown(name)!r} is called '{shown(name)}_{taken[name]}'", "Rename it", "note")
                )
                name = free_name(f"{name}_{taken[name]}", taken)
                taken[name] += 1
            volumes.append(_world_volume(node, child, name))
        if node.optional("type") == "target":
            what = "a target exerted no force in 2014; here it repels all but the link that reaches for it"
            remarks.append(Remark(node, what, 'Write role="ghost" for a thing without force', "note"))
    root.tag, root.children = "world", volumes
    return remarks


def _world_volume(thing: Node, volume: Node, name: str) -> Node:
    """Return one volume of an object with its pose in the root frame; raises RobotFileError if its type is not obstacle or target."""
    attributes = {key: text for key, text in volume.attributes.items() if key not in (*PLACE, *AXIS, "angle", "name")}
    frame, mirrored = _object_rotation(thing)
    turn, _ = _object_rotation(volume)
    shift = frame @ volume.vector(PLACE)
    rotation = frame @ turn
    attributes |= {"name": name} | vector_texts(PLACE, thing.vector(PLACE) + (-shift if mirrored else shift))
    if volume.tag == "box":
        axis, angle = height_and_angle(rotation)
        attributes |= vector_texts(AXIS, axis) | {"angle": degrees(angle)}
    elif volume.tag == "cylinder":
        attributes |= vector_texts(AXIS, rotation[:, 1])
    kind = thing.choice("type", thing.optional("type") or "obstacle", ("obstacle", "target"), "type of object")
    attributes["role"] = kind
    if thing.attributes.keys() & {"r", "g", "b"}:
        channels = [min(max(thing.number(channel, 0.0), 0.0), 255.0) / 255.0 for channel in "rgb"]
        attributes["color"] = " ".join(f"{channel:.4g}" for channel in [*channels, 1.0])
    return Node(volume.file, volume.line, volume.tag, attributes)


def _object_rotation(node: Node) -> tuple[Array, bool]:
    """Return the rotation (3, 3) of an object or volume, and whether the program of 2014 mirrored it, as it did for an axis along -y."""
    if np.linalg.norm(node.vector(AXIS)) <= LOWEST:
        axis = Y
    else:
        axis = direction(node, AXIS)
    mirrored = bool(np.hypot(axis[0], axis[2]) <= UPRIGHT and axis[1] < 0)
    angle = np.deg2rad(node.number("angle", 0.0))
    if mirrored:  # every volume is symmetric about its centre: only the positions of an object's volumes are mirrored
        return turn_about(axis, angle), True
    return height_along(axis, angle), False
