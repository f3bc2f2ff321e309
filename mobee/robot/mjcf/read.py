# SPDX-License-Identifier: Apache-2.0
"""Reads a robot from an MJCF file; docs/robots.md lists the meaning of each element."""

from __future__ import annotations

import warnings
from collections import defaultdict
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue, RobotFileError, Simplified
from mobee.robot.bodies import one_a_link
from mobee.robot.mjcf.compiled import Compiled, compile_mjcf
from mobee.robot.mjcf.motors import drives_of, home_pose, loops, read_motor
from mobee.robot.mjcf.shapes import WITHOUT_BODY, read_cameras, read_solids, read_visuals
from mobee.robot.robot import Body, Joint, Marker, Motor, Part, Robot, Shape
from mobee.robot.urdf.motors import Drive
from mobee.robot.urdf.pairs import PairRules, adjacent_links, shape_pairs, untested_links
from mobee.robot.urdf.read import UrdfOptions, check_options, free_name
from mobee.robot.urdf.shapes import grown
from mobee.robot.urdf.srdf import Srdf
from mobee.robot.urdf.tree import Frame
from mobee.robot.xml.node import SMALLEST

MOST_NAMED = 3  # elements that a warning lists


@dataclass(slots=True, eq=False)
class _Skeleton:
    """The links and joints of the robot as read from MuJoCo's model.

    A body without joints of its own is merged into the link that carries it. `links`: names of the links. `link_of`: for each body of
    MuJoCo the index of its link. `joints`: joints of the robot. `numbers`: for each of these the index of MuJoCo's joint.
    """

    links: list[str]
    link_of: list[int]  # MuJoCo's body -> link of the robot
    joints: list[Joint] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)  # joint of the robot -> MuJoCo's joint


def read_mjcf(path: Path, options: UrdfOptions | None = None) -> Robot:
    """Return the robot of an MJCF file; `options` None: the defaults.

    Motors are named after their joints; positions are in rad, those of slides in m. A free body is fixed where the file places it, and a
    ball joint is fixed in its orientation in the file. Warns (`Simplified`) of elements that are fixed or left out. Raises RobotFileError
    with file and remedy, InvalidValue for options that are not valid, NotInstalled without the package mujoco.
    """
    options = options or UrdfOptions()
    check_options(options)
    if options.srdf is not None:
        raise InvalidValue(f"srdf= is for .urdf files only, and {path} is an MJCF file: its <exclude> elements are read. Leave it out.")
    compiled = compile_mjcf(path)
    drives = drives_of(compiled)
    skeleton = _lay_out(compiled, drives)
    if not skeleton.joints:
        raise RobotFileError(f"{path}: no joint moves. A robot needs a hinge or a slide; draw fixed things in a world file.")
    _warn(compiled)
    motors = _motors(compiled, skeleton, drives, options.home)
    name = compiled.model.names.split(b"\0", 1)[0].decode().strip() or path.stem
    where = _where(compiled, skeleton, name, motors)
    shapes, owners = _shapes(compiled, skeleton, options, where)
    bodies = {body: link for body, link in zip(compiled.names["body"], skeleton.link_of, strict=True)}
    rules = PairRules(bodies, adjacent_links(skeleton.joints, shapes), Srdf(disabled=_excluded(compiled)), "far apart")
    solid_pairs, field_pairs = (shape_pairs(skeleton.joints, shapes, owners, role, rules) for role in ("solid", "field"))
    limits = {j: np.sort(scale * motor.limits + shift) for motor in motors for j, scale, shift in motor.joints}
    return Robot(
        name=name,
        links=tuple(skeleton.links),
        joints=tuple(replace(joint, limits=limits[index]) for index, joint in enumerate(skeleton.joints)),
        motor_table=motors,
        parts={"all": Part("all", tuple(motor.name for motor in motors), 0)},
        markers=_markers(compiled, skeleton, where),
        shapes=tuple(shapes),
        clauses=(),
        field_pairs=field_pairs,
        solid_pairs=solid_pairs,
        base_shapes=frozenset(index for index, shape in enumerate(shapes) if shape.link == 0),
        untested=untested_links(shapes, solid_pairs, rules),
        where=where,
        bodies=_bodies(compiled, skeleton),
        visuals=read_visuals(compiled, skeleton.link_of),
        cameras=read_cameras(compiled, skeleton.link_of),
    )


def _lay_out(compiled: Compiled, drives: dict[int, Drive]) -> _Skeleton:
    """Return the tree of links and joints; of several joints of a body the first carries the second, and so on."""
    model, names = compiled.model, compiled.names
    skeleton, taken = _Skeleton([names["body"][0]], [0]), {names["body"][0]: 0}
    for body in range(1, model.nbody):
        link, start = skeleton.link_of[model.body_parentid[body]], int(model.body_jntadr[body])
        own = [joint for joint in range(start, start + int(model.body_jntnum[body])) if joint in drives]
        for joint in own:
            kind: Literal["revolute", "prismatic"] = "prismatic" if compiled.joint_kinds[joint] == "slide" else "revolute"
            skeleton.joints.append(Joint(names["joint"][joint], link, kind, compiled.axes[joint], compiled.anchors[joint], np.zeros(2)))
            skeleton.numbers.append(joint)
            link = len(skeleton.joints)
            last = joint == own[-1]
            skeleton.links.append(free_name(names["body"][body] if last else f"{names['body'][body]}_{names['joint'][joint]}", taken))
        skeleton.link_of.append(link)
    return skeleton


def _motors(compiled: Compiled, skeleton: _Skeleton, drives: dict[int, Drive], asked: str | None) -> tuple[Motor, ...]:
    groups: dict[str, list[tuple[int, int, Drive]]] = defaultdict(list)
    for index, joint in enumerate(skeleton.numbers):
        drive, name = drives[joint], compiled.names["joint"][joint]
        groups[drive.master].insert(0 if name == drive.master else len(groups[drive.master]), (index, joint, drive))
    home, key = home_pose(compiled, asked)
    return tuple(read_motor(compiled, group, home, key is not None) for group in groups.values())


def _shapes(
    compiled: Compiled, skeleton: _Skeleton, options: UrdfOptions, where: dict[tuple[str, str], str]
) -> tuple[list[Shape], list[str]]:
    """Return the shapes in the order of their links, and for each shape the name of the MuJoCo body that owns it.

    With `UrdfOptions.field`, each solid is followed by its field: a larger shape around it that causes repulsive forces. `where` receives
    the place of each shape in the file, for messages.
    """
    solids = sorted(read_solids(compiled, skeleton.link_of, options.meshes, options.corners), key=lambda one: one[0].link)
    taken: dict[str, int] = dict.fromkeys((solid.name for solid, _ in solids), 0)
    shapes: list[Shape] = []
    owners: list[str] = []
    for solid, geom in solids:
        both = [solid] if options.field is None else [solid, grown(solid, options.field, free_name(f"{solid.name}_field", taken))]
        for shape in both:
            where["shape", shape.name] = compiled.where("geom", geom)
            shapes.append(shape)
            owners.append(compiled.names["body"][int(compiled.model.geom_bodyid[geom])])
    return shapes, owners


def _excluded(compiled: Compiled) -> dict[frozenset[str], str]:
    """Return the pairs of bodies in <exclude> elements, with the reason."""
    names = compiled.names["body"]
    pairs = ((int(code) >> 16, int(code) & 0xFFFF) for code in compiled.model.exclude_signature)
    return {frozenset((names[a], names[b])): f"excluded in the MJCF ({compiled.path.name})" for a, b in pairs if a != b}


def _markers(compiled: Compiled, skeleton: _Skeleton, where: dict[tuple[str, str], str]) -> dict[str, Marker]:
    """Return a marker at each named site, on each body that is fixed to its parent, and on each body at an end of the tree."""
    model = compiled.model
    carrying = set(model.body_parentid.tolist())
    found: dict[str, Marker] = {}
    places: list[tuple[str, int, int, Frame]] = [
        ("site", site, int(model.site_bodyid[site]), compiled.sites[site])
        for site in range(model.nsite)
        if model.site(site).name.strip()  # those without a name mark nothing that a person would ask for
    ]
    for body in range(1, model.nbody):
        if body not in carrying or skeleton.link_of[body] == skeleton.link_of[model.body_parentid[body]]:
            places.append(("body", body, body, compiled.bodies[body]))
    for kind, index, body, frame in places:
        name = compiled.names[kind][index]
        if name not in found:
            found[name] = Marker(name, skeleton.link_of[body], frame.position, frame.rotation, frame.rotation[:, 2])
            where["marker", name] = compiled.where(kind, index)
    return found


def _bodies(compiled: Compiled, skeleton: _Skeleton) -> tuple[Body, ...]:
    found = []
    for body in range(1, compiled.model.nbody):
        mass, frame = float(compiled.model.body_mass[body]), compiled.inertial[body]
        if mass >= SMALLEST:
            inertia: Array = frame.rotation @ np.diag(compiled.model.body_inertia[body]) @ frame.rotation.T
            found.append(Body(skeleton.link_of[body], mass, frame.position, inertia if inertia.any() else None))
    return one_a_link(found)


def _where(compiled: Compiled, skeleton: _Skeleton, name: str, motors: tuple[Motor, ...]) -> dict[tuple[str, str], str]:
    where = {("robot", name): f"{compiled.path}:1", ("part", "all"): f"{compiled.path}:1"}
    for joint, number in zip(skeleton.joints, skeleton.numbers, strict=True):
        where["joint", joint.name] = compiled.where("joint", number)
    for motor in motors:
        where["motor", motor.name] = where["joint", motor.name]
    lines = dict(zip(compiled.names["body"], compiled.lines["body"], strict=True))
    return where | {("link", link): f"{compiled.path}:{max(lines.get(link, 1), 1)}" for link in skeleton.links}


def _warn(compiled: Compiled) -> None:
    """Warn, in one line each, of joints that are held, elements that are left out and loops that are not closed."""
    names = compiled.names
    free = [names["joint"][k] for k, kind in enumerate(compiled.joint_kinds) if kind == "free"]
    balls = [names["joint"][k] for k, kind in enumerate(compiled.joint_kinds) if kind == "ball"]
    fixed = [names["joint"][k] for k in sorted(compiled.held)]
    ground = [names["geom"][k] for k, kind in enumerate(compiled.geom_kinds) if kind in WITHOUT_BODY]
    for found, text in (
        (free, "moves freely: it is held where the file places it, as this library has no floating base"),
        (balls, "is a ball joint: it is held as drawn, as this library has hinges and slides"),
        (fixed, "is held by an equality"),
        (ground, "is ground: it is left out. Draw what the robot may touch in a world file"),
        (loops(compiled), "couples what this library does not: it is left out"),
    ):
        if found:
            listed = ", ".join(found[:MOST_NAMED]) + (f" and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else "")
            warnings.warn(f"{compiled.path}:1: {listed} {text}", Simplified, stacklevel=4)
