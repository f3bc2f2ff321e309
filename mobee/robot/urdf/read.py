# SPDX-License-Identifier: Apache-2.0
"""Reads a robot from a URDF and its SRDF; docs/robots.md lists the meaning of each element."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from numbers import Integral, Real
from pathlib import Path

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.robot.robot import Joint, Motor, Part, Robot, Shape
from mobee.robot.urdf.hull import CORNERS, FEWEST, Corners
from mobee.robot.urdf.layout import Skeleton, lay_out, read_bodies, read_markers
from mobee.robot.urdf.motors import Drive, read_drives, read_motor
from mobee.robot.urdf.pairs import OwnFields, PairRules, adjacent_links, shape_pairs, untested_links
from mobee.robot.urdf.shapes import Meshes, ShapeReader, grown, read_visuals
from mobee.robot.urdf.srdf import Home, Srdf, choose_home, find_srdf, homed, read_parts, read_srdf
from mobee.robot.urdf.tree import Tree, UrdfJoint, read_tree
from mobee.robot.xml.node import Node, read_xml
from mobee.robot.xml.pairs import without_ignored


@dataclass(frozen=True, slots=True)
class UrdfOptions:
    """Options for reading a URDF or MJCF file.

    `field`: distance [m] by which fields, volumes that cause repulsive forces, extend beyond the solids; None: no fields. `meshes`: "hull":
    a mesh becomes its convex hull; "bounding": the smallest sphere, capsule, cylinder or box around it. `corners`: largest number of
    corners of a hull, at least 8; "all": the exact hull. `srdf`: the SRDF file (URDF only); None: an SRDF beside the URDF or in ../srdf
    (`mobee.robot.urdf.srdf.find_srdf`). `home`: the name of a <group_state> (URDF) or a keyframe (MJCF), or "zero"; None: the pose called
    "home", or another pose of the file (`mobee.robot.urdf.srdf.choose_home`, `mobee.robot.mjcf.motors.home_pose`).
    """

    field: float | None = None
    meshes: Meshes = "hull"
    corners: Corners = CORNERS
    srdf: str | Path | None = None
    home: str | None = None


def read_urdf(path: Path, options: UrdfOptions | None = None) -> Robot:
    """Return the robot described by a URDF file; `options` None: the defaults.

    Motors have the names of their joints; their unit is rad, or m for a prismatic joint. Raises RobotFileError with
    file, line, field and remedy, InvalidValue for options out of range; warns of elements that it ignores.
    """
    options = options or UrdfOptions()
    check_options(options)
    root = read_xml(path)
    if root.tag != "robot":
        root.fail("root element", "this is not a URDF file", "Its root is <robot name=...>; run xacro first if it is made by it")
    tree = read_tree(root)
    skeleton = lay_out(tree)
    if not skeleton.moving:
        root.fail("joint", "no joint moves", "A robot needs a revolute, continuous or prismatic joint; draw fixed things in a world file")
    name = root.optional("name") or path.stem
    return _finish(root, name, tree, skeleton, _read_srdf(path, name, options, tree), options)


def check_options(options: UrdfOptions) -> None:
    """Raise InvalidValue if an option is of a wrong type or out of range."""
    if options.field is not None and not (_is(options.field, Real) and 0 < options.field <= 1):
        raise InvalidValue(f"field={options.field!r} is no distance for a field. Give metres, such as field=0.03.")
    if options.meshes not in ("hull", "bounding"):
        raise InvalidValue(f'meshes={options.meshes!r} is unknown. Valid: "hull", "bounding".')
    if options.corners != "all" and not (_is(options.corners, Integral) and options.corners >= FEWEST):
        raise InvalidValue(f'corners={options.corners!r} is no number of corners. Give a whole number from {FEWEST} on, or "all".')
    if not isinstance(options.srdf, str | Path | None):
        raise InvalidValue(f"srdf={options.srdf!r} is no path of an SRDF. Give a path, or leave it out.")
    if not isinstance(options.home, str | None):
        raise InvalidValue(f"home={options.home!r} is no name of a pose. Give a name of the file as text, or leave it out.")


def _is(value: object, kind: type) -> bool:
    return isinstance(value, kind) and not isinstance(value, bool)


def _read_srdf(path: Path, name: str, options: UrdfOptions, tree: Tree) -> Srdf:
    found = find_srdf(path, name) if options.srdf is None else Path(options.srdf)
    return Srdf() if found is None else read_srdf(found, tree)


def _finish(root: Node, name: str, tree: Tree, skeleton: Skeleton, srdf: Srdf, options: UrdfOptions) -> Robot:
    drives = read_drives(tree.joints, skeleton.moving)
    home = choose_home(srdf.states, options.home, srdf.path)
    motors, parts = _motors(tree, skeleton, srdf, drives, home)
    where = _where(root, name, tree, skeleton, srdf, parts)
    if home.state:
        where["pose", home.name] = _place(next(iter(home.state.values()))[0])
    for motor in motors:
        master = drives[skeleton.moving[motor.joints[0][0]].name].master
        where["motor", motor.name] = _place(tree.joints[master].node)
        stated = [skeleton.moving[index].name for index, _, _ in motor.joints if skeleton.moving[index].name in home.state]
        if stated:
            where["home", motor.name] = _place(home.state[stated[0]][0])
    body = _read_body(tree, skeleton, motors, options, where)
    notes = [node for node in root if node.tag == "mobee"]
    joints = tuple(_limited(skeleton.joints, motors))
    rules = PairRules(skeleton.index, adjacent_links(joints, body.shapes), srdf, _own_fields(notes, parts, srdf))
    solid_pairs, field_pairs = (shape_pairs(joints, body.shapes, body.owners, role, rules) for role in ("solid", "field"))
    robot = Robot(
        name=name,
        links=tuple(skeleton.links),
        joints=joints,
        motor_table=motors,
        parts=parts,
        markers={marker.name: marker for marker in read_markers(tree, skeleton, where)},
        shapes=tuple(body.shapes),
        clauses=(),
        field_pairs=field_pairs,
        solid_pairs=solid_pairs,
        base_shapes=frozenset(body.base),
        untested=untested_links(body.shapes, solid_pairs, rules),
        where=where,
        bodies=read_bodies(tree, skeleton),
        visuals=read_visuals(root, tree, skeleton),
    )
    return without_ignored(robot, [node for note in notes for node in note if node.tag == "ignore"])


def _own_fields(notes: list[Node], parts: dict[str, Part], srdf: Srdf) -> OwnFields:
    if any(note.flag("ownFields") for note in notes):
        return "all"  # write_urdf names those that are not tested
    return "none" if set(parts) <= set(srdf.groups) else "far apart"


def _where(root: Node, name: str, tree: Tree, skeleton: Skeleton, srdf: Srdf, parts: dict[str, Part]) -> dict[tuple[str, str], str]:
    where = {("robot", name): _place(root)}
    if srdf.path is not None:
        where["srdf", name] = f"{srdf.path}:1"
    where |= {("part", part): _place(srdf.groups[part][0] if part in srdf.groups else root) for part in parts}
    where |= {("joint", joint.name): _place(joint.node) for joint in skeleton.moving}
    return where | {("link", link): _place(tree.links[link]) for link in skeleton.links}


def _place(node: Node) -> str:
    return f"{node.file}:{node.line}"


def _motors(tree: Tree, skeleton: Skeleton, srdf: Srdf, drives: dict[str, Drive], home: Home) -> tuple[tuple[Motor, ...], dict[str, Part]]:
    driven: dict[str, list[tuple[int, UrdfJoint, Drive]]] = {}
    for index, joint in enumerate(skeleton.moving):
        driven.setdefault(drives[joint.name].master, []).append((index, joint, drives[joint.name]))
    motors: dict[str, Motor] = {}
    parts: dict[str, Part] = {}
    for part, masters in read_parts(srdf, driven, drives).items():
        start = len(motors)
        for name in masters:
            master = tree.joints[name]
            motor = homed(read_motor(master, driven[name], part), home, skeleton.moving)
            if motor.name in motors:
                master.node.fail("name", f"a second motor {motor.name!r}", "Rename one of the two")
            motors[motor.name] = motor
        parts[part] = Part(part, tuple(motors)[start:], start)
    return tuple(motors.values()), parts


def _limited(joints: list[Joint], motors: tuple[Motor, ...]) -> Iterator[Joint]:
    """Yield the joints, with the intervals through which their motors move them as limits."""
    limits: dict[int, Array] = {j: np.sort(scale * motor.limits + shift) for motor in motors for j, scale, shift in motor.joints}
    return (replace(joint, limits=limits[index]) for index, joint in enumerate(joints))


@dataclass(slots=True, eq=False)
class _Body:
    """All shapes, in the order of the links; `owners`: the URDF link of each; `base`: indices of the shapes on the base."""

    shapes: list[Shape] = field(default_factory=list)
    owners: list[str] = field(default_factory=list)
    base: set[int] = field(default_factory=set)


def _read_body(tree: Tree, skeleton: Skeleton, motors: tuple[Motor, ...], options: UrdfOptions, where: dict[tuple[str, str], str]) -> _Body:
    """Read the shapes of all links; shapes on the base belong to the part of the first joint."""
    part_of = {joint + 1: motor.part for motor in motors for joint, _, _ in motor.joints}
    part_of[0] = part_of[1]
    reader = ShapeReader(options.meshes, options.corners, {motor.part for motor in motors})
    body = _Body()
    taken: dict[str, int] = {}
    for link in sorted(skeleton.index, key=skeleton.index.__getitem__):
        index = skeleton.index[link]
        for found in reader.read(tree.links[link], index, skeleton.frames[link], part_of[index]):
            shape = replace(found.shape, name=free_name(found.shape.name, taken))
            both = [shape]
            if options.field is not None and shape.role == "solid":
                both.append(grown(shape, options.field, free_name(f"{shape.name}_field", taken)))
            for one in both:
                where["shape", one.name] = _place(found.node)
                if found.base:
                    body.base.add(len(body.shapes))
                body.shapes.append(one)
                body.owners.append(link)
    return body


def free_name(name: str, taken: dict[str, int]) -> str:
    """Return the name, with a number appended if it is already used, and record the result in `taken`.

    `taken`: used names -> the next number to append.
    """
    if name not in taken:
        taken[name] = 0
        return name
    while f"{name}_{taken[name]}" in taken:
        taken[name] += 1
    return free_name(f"{name}_{taken[name]}", taken)
