"""Reads a robot from zero-position XML (thesis 2.3.1); the grammar is written down in robots/README.md."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from mobee.robot.pairs import LinkPair, joined_links, tested_pairs
from mobee.robot.pairs_2014 import published_pairs
from mobee.robot.robot import Clause, Ints, Joint, Motor, Part, Robot
from mobee.robot.xml_body import read_marker, read_shape, read_skeleton
from mobee.robot.xml_convex import CONVEX_ATTRIBUTES
from mobee.robot.xml_draft import Draft, Place, enter
from mobee.robot.xml_motors import finish_joints, order_motors, read_clauses, read_motor
from mobee.robot.xml_node import Node, nearest, read_xml
from mobee.robot.xml_volume import PLACE, VOLUME_TAGS, direction

AXES = ("x", "y", "z")
BODY_TAGS = VOLUME_TAGS | {"convex": CONVEX_ATTRIBUTES}
KNOWN = {
    "zeropositionkinematictree": frozenset({"version", "robotName", "adjacency"}),
    "bodypart": frozenset({"name"}),
    "link": frozenset({"name", *AXES, "length", "radius", "field", "base"}),
    "joint": frozenset(
        {"name", "moves", "motor", "type", *AXES, "minPos", "maxPos", "length", "radius", "field", "noSelfCollision", "base"}
    ),
    "motor": frozenset({"name", "idx", "minPos", "maxPos", "home", "velocity", "acceleration", "torque"}),
    "marker": frozenset({"name", *PLACE, "nx", "ny", "nz", "rotation"}),
    "constraintlist": frozenset[str](),
    "constraint": frozenset({"a", "q", "b", "negate"}),
    "ignore": frozenset({"first", "second", "role"}),
} | {tag: known | {"name", "field", "base"} for tag, known in BODY_TAGS.items()}


def read_robot(path: Path) -> Robot:
    """The robot described by a zero-position XML file.

    Lengths in the file are in [m], angles in [deg]; everything in the Robot is in SI units, root frame, zero pose.
    Raises RobotFileError with file, line, field and remedy; warns of tags and attributes that it ignores.
    """
    root = read_xml(path)
    if root.tag != "zeropositionkinematictree":
        root.fail("root element", "this is not a robot", "The root of a robot file is <ZeroPositionKinematicTree robotName=...>")
    root.check_attributes(KNOWN[root.tag])
    draft = Draft()
    _read_children(root, draft, Place(np.zeros(3)))
    if not draft.parts:
        root.fail("bodypart", "the robot has no body part", 'Put its motors and links inside <bodypart name="...">')
    return _finish(root, draft, root.attributes.get("robotName", path.stem))


def _read_children(parent: Node, draft: Draft, place: Place) -> None:
    for node in parent:
        if node.tag not in KNOWN:
            node.warn(f"unknown tag is ignored with all inside. {nearest(node.tag, KNOWN)}Valid: {', '.join(sorted(KNOWN))}")
            continue
        node.check_attributes(KNOWN[node.tag])
        if node.tag in BODY_TAGS:
            read_shape(node, draft, place)
        else:
            READERS.get(node.tag, _misplaced)(node, draft, place)


def _misplaced(node: Node, draft: Draft, place: Place) -> None:
    node.fail("position in the file", "this tag cannot stand here", "<constraint> stands in <constraintList>, the root only once")


def _read_part(node: Node, draft: Draft, place: Place) -> None:
    name = node.text("name")
    draft.parts.setdefault(name, []).append(node)
    _read_children(node, draft, replace(place, part=name))


def _read_motor(node: Node, draft: Draft, place: Place) -> None:
    if not place.part:
        node.fail("position in the file", "a motor outside of every part", "Move it into a <bodypart>")
    motor = read_motor(node, place.part, len(draft.motors))
    if motor.name in draft.motors:
        node.fail("name", f"a second motor {motor.name!r}", f"The first is in line {draft.motors[motor.name].node.line}: rename one")
    draft.motors[motor.name] = motor
    _read_children(node, draft, replace(place, motor=motor.name))


def _read_link(node: Node, draft: Draft, place: Place) -> None:
    here = enter(node, draft, replace(place, base=place.base and node.flag("base", default=True)))
    step = node.vector(AXES)
    length = float(np.linalg.norm(step))
    if "length" in node.attributes:
        step = direction(node, AXES) * node.positive("length")
        length = node.positive("length")
    if place.link == 0 and "name" in node.attributes:
        draft.links[0] = node.text("name")
    read_skeleton(node, draft, here, place.point + step / 2, step, length)
    _read_children(node, draft, replace(here, point=place.point + step))


def _read_joint(node: Node, draft: Draft, place: Place) -> None:
    index = len(draft.joints)
    axis = direction(node, AXES)
    motor = node.attributes.get("motor", place.motor) or node.missing("motor")
    name = node.attributes.get("name") or (motor if all(motor != used for _, used in draft.drives) else f"{motor}_{index}")
    kind = node.choice("type", node.attributes.get("type", "revolute"), ("revolute", "prismatic"), "type of joint")
    link = node.attributes.get("moves", name)
    if link in draft.links or any(name == joint.name for joint in draft.joints):
        node.fail("name", f"a second joint {name!r} or link {link!r}", "Give every joint its own name and every link it moves another")
    draft.joints.append(Joint(name, place.link, "revolute" if kind == "revolute" else "prismatic", axis, place.point, np.zeros(2)))
    draft.drives.append((node, motor))
    draft.links.append(link)
    subtree = index + 1 if node.flag("noSelfCollision") and place.subtree < 0 else place.subtree
    draft.subtree.append(subtree)
    here = enter(node, draft, replace(place, link=index + 1, motor=motor, subtree=subtree, base=node.flag("base")))
    length = node.positive("length", float(np.linalg.norm(node.vector(AXES))))
    read_skeleton(node, draft, here, place.point, axis, length)
    _read_children(node, draft, here)


def _read_constraints(node: Node, draft: Draft, place: Place) -> None:
    if not place.part:
        node.fail("position in the file", "constraints outside of every part", "Move them into the <bodypart> whose motors they name")
    draft.constraints.append((place.part, node))


def _read_ignore(node: Node, draft: Draft, place: Place) -> None:
    draft.ignores.append(node)


READERS = {
    "bodypart": _read_part,
    "motor": _read_motor,
    "link": _read_link,
    "joint": _read_joint,
    "marker": read_marker,
    "constraintlist": _read_constraints,
    "ignore": _read_ignore,
}


def _finish(root: Node, draft: Draft, name: str) -> Robot:
    motors = order_motors(draft.motors, draft.parts)
    parts = {part: Part(part, (), 0) for part in draft.parts}
    for part in draft.parts:
        names = tuple(motor.name for motor in motors if motor.part == part)
        if not names:
            draft.parts[part][0].fail("motor", f"part {part!r} has no motor", "Add a <motor> or move its links into another part")
        parts[part] = Part(part, names, next(k for k, motor in enumerate(motors) if motor.part == part))
    joints, table = finish_joints(draft.joints, draft.drives, motors)
    rule = root.choice("adjacency", root.attributes.get("adjacency", "joined"), ("joined", "published_2014"), "rule")
    return Robot(
        name=name,
        links=tuple(draft.links),
        joints=joints,
        motor_table=table,
        parts=parts,
        markers=draft.markers,
        shapes=tuple(draft.shapes),
        clauses=_clauses(draft, table, parts),
        field_pairs=_pairs(draft, joints, rule, "field"),
        solid_pairs=_pairs(draft, joints, rule, "solid"),
        base_shapes=frozenset(draft.base_shapes),
    )


def _pairs(draft: Draft, joints: tuple[Joint, ...], rule: str, role: str) -> Ints:
    if rule == "published_2014":
        return published_pairs(draft.elements, draft.hosts, draft.shapes, role, _ignored(draft, role))
    return tested_pairs(draft.shapes, role, joined_links(joints), draft.subtree, _ignored(draft, role))


def _clauses(draft: Draft, table: tuple[Motor, ...], parts: dict[str, Part]) -> tuple[Clause, ...]:
    names = tuple(motor.name for motor in table)
    return tuple(read_clauses(node, parts[part], names) for part, node in draft.constraints)


def _ignored(draft: Draft, role: str) -> set[LinkPair]:
    pairs = set()
    for node in draft.ignores:
        if node.choice("role", node.attributes.get("role", "both"), ("solid", "field", "both"), "role") not in (role, "both"):
            continue
        ends = [node.choice(end, node.text(end), draft.links, "link") for end in ("first", "second")]
        pairs.add(frozenset(draft.links.index(end) for end in ends))
    return pairs
