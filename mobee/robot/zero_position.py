"""Reads a robot from zero-position XML (thesis 2.3.1); the grammar is written down in robots/README.md."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from mobee.robot.pairs import LinkPair, joined_links, tested_pairs
from mobee.robot.robot import Array, Clause, Joint, Marker, Motor, Part, Robot, Shape
from mobee.robot.xml_motors import MotorDraft, finish_joints, order_motors, read_clauses, read_motor
from mobee.robot.xml_node import Node, nearest, read_xml
from mobee.robot.xml_volume import PLACE, VOLUME_TAGS, Z, align, direction, read_volume

AXES = ("x", "y", "z")
KNOWN = {
    "zeropositionkinematictree": frozenset({"version", "robotName"}),
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
} | {tag: known | {"name", "field", "base"} for tag, known in VOLUME_TAGS.items()}


@dataclass(slots=True)
class _Draft:
    """What has been read so far."""

    links: list[str] = field(default_factory=lambda: ["base"])
    subtree: list[int] = field(default_factory=lambda: [-1])
    joints: list[Joint] = field(default_factory=list)
    drives: list[tuple[Node, str]] = field(default_factory=list)  # for each joint its element and the name of its motor
    motors: dict[str, MotorDraft] = field(default_factory=dict)
    parts: dict[str, list[Node]] = field(default_factory=dict)
    shapes: list[Shape] = field(default_factory=list)
    base_shapes: set[int] = field(default_factory=set)
    markers: dict[str, Marker] = field(default_factory=dict)
    constraints: list[tuple[str, Node]] = field(default_factory=list)
    ignores: list[Node] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class _Place:
    """Where in the tree a child stands: the current point [m], the link it is on, its part, motor and hand subtree."""

    point: Array
    link: int = 0
    part: str = ""
    motor: str = ""
    subtree: int = -1
    base: bool = True


def read_robot(path: Path) -> Robot:
    """The robot described by a zero-position XML file.

    Lengths in the file are in [m], angles in [deg]; everything in the Robot is in SI units, root frame, zero pose.
    Raises RobotFileError with file, line, field and remedy; warns of tags and attributes that it ignores.
    """
    root = read_xml(path)
    if root.tag != "zeropositionkinematictree":
        root.fail("root element", "this is not a robot", "The root of a robot file is <ZeroPositionKinematicTree robotName=...>")
    root.check_attributes(KNOWN[root.tag])
    draft = _Draft()
    _read_children(root, draft, _Place(np.zeros(3)))
    if not draft.parts:
        root.fail("bodypart", "the robot has no body part", 'Put its motors and links inside <bodypart name="...">')
    return _finish(root, draft, root.attributes.get("robotName", path.stem))


def _read_children(parent: Node, draft: _Draft, place: _Place) -> None:
    for node in parent:
        if node.tag not in KNOWN:
            node.warn(f"unknown tag is ignored with all inside. {nearest(node.tag, KNOWN)}Valid: {', '.join(sorted(KNOWN))}")
            continue
        node.check_attributes(KNOWN[node.tag])
        if node.tag in VOLUME_TAGS:
            _read_shape(node, draft, place)
        else:
            READERS.get(node.tag, _misplaced)(node, draft, place)


def _misplaced(node: Node, draft: _Draft, place: _Place) -> None:
    node.fail("position in the file", "this tag cannot stand here", "<constraint> stands in <constraintList>, the root only once")


def _read_part(node: Node, draft: _Draft, place: _Place) -> None:
    name = node.text("name")
    draft.parts.setdefault(name, []).append(node)
    _read_children(node, draft, replace(place, part=name))


def _read_motor(node: Node, draft: _Draft, place: _Place) -> None:
    if not place.part:
        node.fail("position in the file", "a motor outside of every part", "Move it into a <bodypart>")
    motor = read_motor(node, place.part, len(draft.motors))
    if motor.name in draft.motors:
        node.fail("name", f"a second motor {motor.name!r}", f"The first is in line {draft.motors[motor.name].node.line}: rename one")
    draft.motors[motor.name] = motor
    _read_children(node, draft, replace(place, motor=motor.name))


def _read_link(node: Node, draft: _Draft, place: _Place) -> None:
    base = place.base and node.flag("base", default=True)
    step = node.vector(AXES)
    length = float(np.linalg.norm(step))
    if "length" in node.attributes:
        step = direction(node, AXES) * node.positive("length")
        length = node.positive("length")
    if place.link == 0 and "name" in node.attributes:
        draft.links[0] = node.text("name")
    _read_skeleton(node, draft, replace(place, base=base), place.point + step / 2, step, length)
    _read_children(node, draft, replace(place, point=place.point + step, base=base))


def _read_joint(node: Node, draft: _Draft, place: _Place) -> None:
    index = len(draft.joints)
    axis = direction(node, AXES)
    motor = node.attributes.get("motor", place.motor)
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
    here = replace(place, link=index + 1, motor=motor, subtree=subtree, base=node.flag("base"))
    length = node.positive("length", float(np.linalg.norm(node.vector(AXES))))
    _read_skeleton(node, draft, here, place.point, axis, length)
    _read_children(node, draft, here)


def _read_skeleton(node: Node, draft: _Draft, place: _Place, centre: Array, axis: Array, length: float) -> None:
    """The cylinders that `radius` and `field` of a link or joint stand for."""
    for attribute, role in (("radius", "solid"), ("field", "field")):
        if node.number(attribute, 0.0) == 0:
            continue
        if length == 0:
            node.fail(attribute, "a link without length has no volume", f"Remove {attribute} or give x, y, z")
        rotation = align(Z, axis / np.linalg.norm(axis))
        name = node.attributes.get("name") or f"{node.tag}_{node.line}"
        shape = Shape(
            _free_name(draft, name if role == "solid" else f"{name}_field"),
            place.link,
            "cylinder",
            (node.positive(attribute), length),
            centre,
            rotation,
            "solid" if role == "solid" else "field",
            place.part,
        )
        _add_shape(draft, shape, place.base)


def _read_shape(node: Node, draft: _Draft, place: _Place) -> None:
    volume = read_volume(node)
    name = node.attributes.get("name") or _free_name(draft, f"{draft.links[place.link]}_{node.tag}")
    if any(name == shape.name for shape in draft.shapes):
        node.fail("name", f"a second shape {name!r}", "Rename one of the two")
    role = "field" if node.flag("field") else "solid"
    shape = Shape(name, place.link, volume.kind, volume.size, place.point + volume.centre, volume.rotation, "solid", place.part)
    _add_shape(draft, replace(shape, role="field") if role == "field" else shape, node.flag("base", default=place.base))


def _add_shape(draft: _Draft, shape: Shape, base: bool) -> None:
    if base:
        draft.base_shapes.add(len(draft.shapes))
    draft.shapes.append(shape)


def _free_name(draft: _Draft, name: str) -> str:
    used = {shape.name for shape in draft.shapes}
    return name if name not in used else next(f"{name}_{k}" for k in range(len(used) + 1) if f"{name}_{k}" not in used)


def _read_marker(node: Node, draft: _Draft, place: _Place) -> None:
    name = node.text("name")
    if name in draft.markers:
        node.fail("name", f"a second marker {name!r}", "Rename one of the two")
    given = any(axis in node.attributes for axis in ("nx", "ny", "nz"))
    normal = direction(node, ("nx", "ny", "nz")) if given else Z
    rotation = align(Z, normal)
    if "rotation" in node.attributes:
        rotation = np.array(node.numbers("rotation", 9)).reshape(3, 3)
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-4 or np.linalg.det(rotation) < 0:
            node.fail("rotation", "is not a rotation matrix", "Write a right-handed orthonormal 3 x 3 matrix row by row")
        left, _, right = np.linalg.svd(rotation)  # the nearest exact rotation to what the digits of the file say
        rotation = left @ right
        normal = normal if given else rotation[:, 2]
    draft.markers[name] = Marker(name, place.link, place.point + node.vector(PLACE), rotation, normal)


def _read_constraints(node: Node, draft: _Draft, place: _Place) -> None:
    if not place.part:
        node.fail("position in the file", "constraints outside of every part", "Move them into the <bodypart> whose motors they name")
    draft.constraints.append((place.part, node))


def _read_ignore(node: Node, draft: _Draft, place: _Place) -> None:
    draft.ignores.append(node)


READERS = {
    "bodypart": _read_part,
    "motor": _read_motor,
    "link": _read_link,
    "joint": _read_joint,
    "marker": _read_marker,
    "constraintlist": _read_constraints,
    "ignore": _read_ignore,
}


def _finish(root: Node, draft: _Draft, name: str) -> Robot:
    motors = order_motors(draft.motors, draft.parts)
    parts = {part: Part(part, (), 0) for part in draft.parts}
    for part in draft.parts:
        names = tuple(motor.name for motor in motors if motor.part == part)
        if not names:
            draft.parts[part][0].fail("motor", f"part {part!r} has no motor", "Add a <motor> or move its links into another part")
        parts[part] = Part(part, names, next(k for k, motor in enumerate(motors) if motor.part == part))
    joints, table = finish_joints(draft.joints, draft.drives, motors)
    pairs = {
        role: tested_pairs(draft.shapes, role, joined_links(joints), draft.subtree, _ignored(draft, role)) for role in ("field", "solid")
    }
    return Robot(
        name=name,
        links=tuple(draft.links),
        joints=joints,
        motor_table=table,
        parts=parts,
        markers=draft.markers,
        shapes=tuple(draft.shapes),
        clauses=_clauses(draft, table, parts),
        field_pairs=pairs["field"],
        solid_pairs=pairs["solid"],
        base_shapes=frozenset(draft.base_shapes),
    )


def _clauses(draft: _Draft, table: tuple[Motor, ...], parts: dict[str, Part]) -> tuple[Clause, ...]:
    names = tuple(motor.name for motor in table)
    return tuple(read_clauses(node, parts[part], names) for part, node in draft.constraints)


def _ignored(draft: _Draft, role: str) -> set[LinkPair]:
    pairs = set()
    for node in draft.ignores:
        if node.choice("role", node.attributes.get("role", "both"), ("solid", "field", "both"), "role") not in (role, "both"):
            continue
        ends = [node.choice(end, node.text(end), draft.links, "link") for end in ("first", "second")]
        pairs.add(frozenset(draft.links.index(end) for end in ends))
    return pairs
