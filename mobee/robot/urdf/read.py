"""Reads a robot from a URDF file, and from the SRDF beside it: see docs/robots.md for what becomes of what."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from mobee.errors import InvalidValue
from mobee.robot.robot import Array, Joint, Marker, Motor, Part, Robot, Shape
from mobee.robot.urdf.frames import IDENTITY, Frame, child, triple
from mobee.robot.urdf.motors import Drive, joint_limits, read_drives, read_motor
from mobee.robot.urdf.pairs import PairRules, adjacent_links, shape_pairs, untested_links
from mobee.robot.urdf.shapes import Meshes, ShapeReader, grown
from mobee.robot.urdf.srdf import Srdf, read_parts, read_srdf
from mobee.robot.urdf.tree import MOVING, Tree, UrdfJoint, read_tree
from mobee.robot.xml_node import Node, read_xml
from mobee.robot.xml_volume import Z, turn_about


@dataclass(frozen=True, slots=True)
class UrdfOptions:
    """How a URDF is to be read.

    `field`: how much farther than the body the fields reach, in [m]; None: no fields. `meshes`: the convex hull of a mesh
    ("hull"), or the smallest sphere, capsule, cylinder or box around it ("bounding"). `srdf`: the SRDF file, else the one beside.
    """

    field: float | None = None
    meshes: Meshes = "hull"
    srdf: str | Path | None = None


@dataclass(slots=True, eq=False)
class _Skeleton:
    """The tree laid out at zero pose; the links of fixed joints have become part of what carries them."""

    links: list[str]
    index: dict[str, int]  # URDF link -> link of the robot
    frames: dict[str, Frame]  # URDF link -> its frame, root frame
    joints: list[Joint] = field(default_factory=list)
    moving: list[UrdfJoint] = field(default_factory=list)
    marked: list[str] = field(default_factory=list)  # links that become markers


def read_urdf(path: Path, options: UrdfOptions | None = None) -> Robot:
    """The robot described by a URDF file.

    Motors are named after their joints and count in [rad], those of prismatic joints in [m]. Raises RobotFileError with
    file, line, field and remedy, InvalidValue for options out of range; warns of what it ignores.
    """
    options = options or UrdfOptions()
    _check(options)
    root = read_xml(path)
    if root.tag != "robot":
        root.fail("root element", "this is not a URDF file", "Its root is <robot name=...>; run xacro first if it is made by it")
    tree = read_tree(root)
    skeleton = _lay_out(tree)
    if not skeleton.moving:
        root.fail("joint", "no joint moves", "A robot needs a revolute, continuous or prismatic joint; draw fixed things in a world file")
    return _finish(root, path, tree, skeleton, _find_srdf(path, options, tree), options)


def _check(options: UrdfOptions) -> None:
    if options.field is not None and not 0 < options.field <= 1:
        raise InvalidValue(f"field={options.field!r} is no distance for a field. Give metres, such as field=0.03.")
    if options.meshes not in ("hull", "bounding"):
        raise InvalidValue(f'meshes={options.meshes!r} is unknown. Valid: "hull", "bounding".')


def _find_srdf(path: Path, options: UrdfOptions, tree: Tree) -> Srdf:
    beside = path.with_suffix(".srdf")
    if options.srdf is not None:
        return read_srdf(Path(options.srdf), tree)
    return read_srdf(beside, tree) if beside.is_file() else Srdf()


def _lay_out(tree: Tree) -> _Skeleton:
    skeleton = _Skeleton([tree.root], {tree.root: 0}, {tree.root: IDENTITY})
    for joint in tree.walk():
        frame = skeleton.frames[joint.parent] @ joint.origin
        parent = skeleton.index[joint.parent]
        held = IDENTITY if joint.kind == "fixed" else _locked(joint)
        if held is not None:
            skeleton.frames[joint.child] = frame @ held
            skeleton.index[joint.child] = parent
            skeleton.marked.append(joint.child)
            continue
        axis = frame.rotation @ joint.axis
        kind: Literal["revolute", "prismatic"] = "prismatic" if joint.kind == "prismatic" else "revolute"
        skeleton.joints.append(Joint(joint.name, parent, kind, axis / np.linalg.norm(axis), frame.position, np.zeros(2)))
        skeleton.moving.append(joint)
        skeleton.links.append(joint.child)
        skeleton.frames[joint.child] = frame
        skeleton.index[joint.child] = len(skeleton.joints)
        if joint.child not in tree.below:
            skeleton.marked.append(joint.child)
    return skeleton


def _locked(joint: UrdfJoint) -> Frame | None:
    """Where a joint whose limits leave it one place holds what it carries; None for one that moves."""
    if child(joint.node, "mimic") is not None or child(joint.node, "limit") is None or joint.kind not in MOVING:
        return None
    low, high = joint_limits(joint)
    if high > low:
        return None
    joint.node.warn(f"joint {joint.name!r} has lower = upper = {low:g}, so it is fixed there")
    return Frame(low * joint.axis, np.eye(3)) if joint.kind == "prismatic" else Frame(np.zeros(3), turn_about(joint.axis, low))


def _finish(root: Node, path: Path, tree: Tree, skeleton: _Skeleton, srdf: Srdf, options: UrdfOptions) -> Robot:
    drives = read_drives(tree.joints, skeleton.moving)
    motors, parts = _motors(tree, skeleton, srdf, drives)
    part_of = {joint: motor.part for motor in motors for joint, _, _ in motor.joints}
    where = {("robot", root.attributes.get("name", path.stem)): f"{path}:{root.line}"}
    shapes, owners = _shapes(tree, skeleton, ["", *(part_of[k] for k in range(len(skeleton.joints)))], options, where)
    rules = PairRules(skeleton.index, adjacent_links(skeleton.joints, shapes), srdf)
    solid_pairs = shape_pairs(shapes, owners, "solid", rules)
    markers = {marker.name: marker for marker in _markers(tree, skeleton, where)}
    where |= {("joint", joint.name): f"{path}:{joint.node.line}" for joint in skeleton.moving}
    where |= {("link", name): f"{path}:{tree.links[name].line}" for name in skeleton.links}
    for motor in motors:
        joint = skeleton.moving[motor.joints[0][0]]
        where["motor", motor.name] = f"{path}:{tree.joints[drives[joint.name].master].node.line}"
    where |= {("part", name): _place(srdf.groups[name][0]) if name in srdf.groups else f"{path}:{root.line}" for name in parts}
    return Robot(
        name=root.attributes.get("name", path.stem),
        links=tuple(skeleton.links),
        joints=tuple(_limited(skeleton.joints, motors)),
        motor_table=motors,
        parts=parts,
        markers=markers,
        shapes=tuple(shapes),
        clauses=(),
        field_pairs=shape_pairs(shapes, owners, "field", rules),
        solid_pairs=solid_pairs,
        base_shapes=frozenset(index for index, shape in enumerate(shapes) if shape.link == 0),
        untested=untested_links(shapes, solid_pairs, rules),
        where=where,
    )


def _place(node: Node) -> str:
    return f"{node.file}:{node.line}"


def _motors(tree: Tree, skeleton: _Skeleton, srdf: Srdf, drives: dict[str, Drive]) -> tuple[tuple[Motor, ...], dict[str, Part]]:
    driven: dict[str, list[tuple[int, UrdfJoint, Drive]]] = {}
    for index, joint in enumerate(skeleton.moving):
        driven.setdefault(drives[joint.name].master, []).append((index, joint, drives[joint.name]))
    motors: dict[str, Motor] = {}
    parts: dict[str, Part] = {}
    for part, masters in read_parts(srdf, driven, drives).items():
        start = len(motors)
        for name in masters:
            master = tree.joints[name]
            motor = _homed(read_motor(master, driven[name], part), srdf, skeleton.moving)
            if motor.name in motors:
                master.node.fail("name", f"a second motor {motor.name!r}", "Rename one of the two")
            motors[motor.name] = motor
        parts[part] = Part(part, tuple(motors)[start:], start)
    return tuple(motors.values()), parts


def _homed(motor: Motor, srdf: Srdf, moving: list[UrdfJoint]) -> Motor:
    """The motor with the home of the SRDF, which speaks of joints."""
    for index, scale, offset in motor.joints:
        if moving[index].name not in srdf.home:
            continue
        node, value = srdf.home[moving[index].name]
        home = (value - offset) / scale
        low, high = motor.limits
        if not low - 1e-6 <= home <= high + 1e-6:
            node.fail("value", f"{value:g} puts {motor.name!r} outside of {low:g} .. {high:g}", "Choose a home within the limits")
        return replace(motor, home=float(np.clip(home, low, high)))
    return motor


def _limited(joints: list[Joint], motors: tuple[Motor, ...]) -> Iterator[Joint]:
    """The joints with the intervals that their motors move them through."""
    limits: dict[int, Array] = {j: np.sort(scale * motor.limits + shift) for motor in motors for j, scale, shift in motor.joints}
    return (replace(joint, limits=limits[index]) for index, joint in enumerate(joints))


def _shapes(
    tree: Tree, skeleton: _Skeleton, parts: list[str], options: UrdfOptions, where: dict[tuple[str, str], str]
) -> tuple[list[Shape], list[str]]:
    """All shapes, links in order, and the URDF link of each; what is on the base belongs to the part of the first joint."""
    reader = ShapeReader(options.meshes, {})
    shapes: list[Shape] = []
    owners: list[str] = []
    taken: dict[str, int] = {}
    for name in sorted(skeleton.index, key=skeleton.index.__getitem__):
        index = skeleton.index[name]
        for node, read in reader.read(tree.links[name], index, skeleton.frames[name], parts[index] or parts[1]):
            shape = replace(read, name=_free(read.name, taken))
            both = [shape]
            if options.field is not None and shape.role == "solid":
                both.append(grown(shape, options.field, _free(f"{shape.name}_field", taken)))
            for one in both:
                where["shape", one.name] = _place(node)
                owners.append(name)
            shapes += both
    return shapes, owners


def _free(name: str, taken: dict[str, int]) -> str:
    """The name, or with the first number behind it that makes it the only one."""
    if name not in taken:
        taken[name] = 0
        return name
    while f"{name}_{taken[name]}" in taken:
        taken[name] += 1
    return _free(f"{name}_{taken[name]}", taken)


def _markers(tree: Tree, skeleton: _Skeleton, where: dict[tuple[str, str], str]) -> Iterator[Marker]:
    """A marker for the frame of every link that a fixed joint holds, and of every link at an end of the tree."""
    notes = {link: note for link in skeleton.marked for note in tree.links[link] if note.tag == "mobee" and "marker" in note.attributes}
    taken: set[str] = set()
    for link in sorted(skeleton.marked, key=lambda name: name not in notes):  # names that write_urdf noted come first
        node, frame = notes.get(link, tree.links[link]), skeleton.frames[link]
        name = node.text("marker") if link in notes else link
        if name in taken and link in notes:
            node.fail("marker", f"a second marker {name!r}", "Rename one of the two")
        if name in taken:
            continue
        taken.add(name)
        where["marker", name] = _place(node)
        normal = frame.rotation @ (_normal(node) if link in notes else Z)
        yield Marker(name, skeleton.index[link], frame.position, frame.rotation, normal)


def _normal(note: Node) -> Array:
    """The direction that `write_urdf` noted, in the link's frame; z where there is none."""
    if "normal" not in note.attributes:
        return Z
    normal = triple(note, "normal")
    length = float(np.linalg.norm(normal))
    if length < 1e-9:
        note.fail("normal", "has no length", "Write a direction in the link's frame, such as 0 0 1")
    return normal / length
