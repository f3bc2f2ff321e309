# SPDX-License-Identifier: Apache-2.0
"""Joins several robots into one model, for instance a Katana beside the iCub (thesis figure 2.1)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, real_array
from mobee.errors import InvalidValue, UnknownName
from mobee.robot.bodies import one_a_link
from mobee.robot.pairs import joined_pairs, joined_untested
from mobee.robot.robot import Body, Camera, Clause, Joint, Marker, Motor, Part, Robot, Shape, Visual

SEPARATOR = "_"  # part names are in keys of the bus: a-z, 0-9 and _ only


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A robot to be joined with others.

    `prefix`: text before its names in the joined robot; "": none. `position` (3,) m, `rotation` (3, 3): of its root frame in the common
    root frame.
    """

    prefix: str
    robot: Robot
    position: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array = field(default_factory=lambda: np.eye(3))

    def name(self, own: str) -> str:
        """Return the name that a part, motor, joint, link, marker, shape or camera of this robot has in the joined robot.

        `own`: its name in this robot.
        """
        return f"{self.prefix}{SEPARATOR}{own}" if self.prefix else own


def join_robots(
    robots: Mapping[str, Robot], places: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None, name: str | None = None
) -> Robot:
    """Join several robots into one.

    `robots`: the robots, by key. `places`: by the same keys, position (3,) m and rotation (3, 3) of a robot's root frame in the common root
    frame; default: the common root frame itself. `name`: name of the joined robot; None: the keys with "_" between them. Names of parts,
    motors, joints, links, markers, shapes and cameras get the key and "_" as a prefix; the key "" leaves them unchanged. Parts and motors
    are in the order given. The bases become one link, with the name of the first base. Every solid is tested against all solids of the
    other robots, every field (volume that causes a repulsive force) against all their fields; within a robot its own pairs are kept. The
    joined robot has the largest `Robot.least_lever` of all robots. This number scales the forces of fields: robots with a smaller value get
    other forces from contacts than before. Raises InvalidValue for equal names, for no robots, for an argument of a wrong type and for a
    place that is not a pose; UnknownName for a place without a robot.
    """
    if not isinstance(robots, Mapping):
        raise InvalidValue(f'robots is a {type(robots).__name__}; it must be a dict, such as {{"left": one, "right": other}}.')
    for key, robot in robots.items():
        if not isinstance(key, str):
            raise InvalidValue(f'robots has the key {key!r}; a key must be text, which the names begin with, such as "left".')
        if not isinstance(robot, Robot):
            raise InvalidValue(f"robot {key!r} is {robot!r}; it must be a Robot, as load_robot returns it.")
    if not isinstance(name, str | None):
        raise InvalidValue(f"name is {name!r}; it must be text, or None.")
    for key in places or {}:
        if key not in robots:
            raise UnknownName("robot", key, robots)
    stand = {key: (np.zeros(3), np.eye(3)) for key in robots} | {key: _pose(key, place) for key, place in (places or {}).items()}
    placed = [Placed(key, robot, *stand[key]) for key, robot in robots.items()]
    return join_placed(placed, name or SEPARATOR.join(key or robot.name for key, robot in robots.items()))


def join_placed(placed: Sequence[Placed], name: str) -> Robot:
    """Join several placed robots into one robot with the given name, by the rules of `mobee.robot.join.join_robots`.

    Raises InvalidValue for equal names and for no robots.
    """
    if not placed:
        raise InvalidValue("there is no robot to join. Give at least one.")
    joints = np.cumsum([0, *(len(one.robot.joints) for one in placed)]).tolist()
    motors = np.cumsum([0, *(len(one.robot.motor_table) for one in placed)]).tolist()
    bodies = [_shifted(one, joints[k], motors[k], motors[-1]) for k, one in enumerate(placed)]
    _check_names(bodies)
    shapes = tuple(shape for body in bodies for shape in body.shapes)
    starts = np.cumsum([0, *(len(body.shapes) for body in bodies)]).tolist()
    solid_pairs, field_pairs = (joined_pairs(bodies, starts, role) for role in ("solid", "field"))
    where: dict[tuple[str, str], str] = {}
    clauses = 0
    for body in bodies:
        for (kind, own), line in body.where.items():
            where.setdefault((kind, str(int(own) + clauses) if kind == "clause" else own), line)
        clauses += len(body.clauses)
    return Robot(
        name=name,
        links=(bodies[0].links[0], *(link for body in bodies for link in body.links[1:])),
        joints=tuple(joint for body in bodies for joint in body.joints),
        motor_table=tuple(motor for body in bodies for motor in body.motor_table),
        parts={key: part for body in bodies for key, part in body.parts.items()},
        markers={key: marker for body in bodies for key, marker in body.markers.items()},
        shapes=shapes,
        clauses=tuple(clause for body in bodies for clause in body.clauses),
        field_pairs=field_pairs,
        solid_pairs=solid_pairs,
        base_shapes=frozenset(index + start for body, start in zip(bodies, starts, strict=False) for index in body.base_shapes),
        untested=joined_untested(bodies, shapes, (solid_pairs, field_pairs)),
        where=where,
        bodies=one_a_link(mass for body in bodies for mass in body.bodies),
        visuals=tuple(visual for body in bodies for visual in body.visuals),
        cameras={key: camera for body in bodies for key, camera in body.cameras.items()},
        least_lever=max(body.least_lever for body in bodies),
    )


def _shifted(one: Placed, joints: int, motors: int, all_motors: int) -> Robot:
    """Return the robot of `one` as it is in the joined robot: with prefixed names, new indices, and the pose of its root frame.

    `joints`, `motors`: numbers of joints and of motors of the robots before it. `all_motors`: number of motors of all robots.
    """
    robot, turn = one.robot, one.rotation

    def link(index: int) -> int:
        return index + joints if index else 0

    def point(position: Array) -> Array:
        moved: Array = turn @ position + one.position
        return moved

    def joint(old: Joint) -> Joint:
        return replace(old, name=one.name(old.name), parent=link(old.parent), axis=turn @ old.axis, point=point(old.point))

    def motor(old: Motor) -> Motor:
        driven = tuple((index + joints, scale, shift) for index, scale, shift in old.joints)
        return replace(old, name=one.name(old.name), part=one.name(old.part), joints=driven)

    def part(old: Part) -> Part:
        return Part(one.name(old.name), tuple(map(one.name, old.motors)), old.start + motors)

    def marker(old: Marker) -> Marker:
        moved = replace(old, position=point(old.position), rotation=turn @ old.rotation, normal=turn @ old.normal)
        return replace(moved, name=one.name(old.name), link=link(old.link))

    def shape(old: Shape) -> Shape:
        moved = replace(old, position=point(old.position), rotation=turn @ old.rotation)
        return replace(moved, name=one.name(old.name), part=one.name(old.part), link=link(old.link))

    def body(old: Body) -> Body:
        inertia = None if old.inertia is None else turn @ old.inertia @ turn.T
        return Body(link(old.link), old.mass, point(old.centre), inertia)

    def visual(old: Visual) -> Visual:
        return replace(old, position=point(old.position), rotation=turn @ old.rotation, link=link(old.link))

    def camera(old: Camera) -> Camera:
        moved = replace(old, position=point(old.position), rotation=turn @ old.rotation)
        return replace(moved, name=one.name(old.name), link=link(old.link), hidden=frozenset(map(link, old.hidden)))

    def clause(old: Clause) -> Clause:
        a = np.zeros((len(old.b), all_motors))
        a[:, motors : motors + old.a.shape[1]] = old.a
        return Clause(one.name(old.part), a, old.b)

    return replace(
        robot,
        name=one.name(robot.name),
        links=tuple(map(one.name, robot.links)),
        joints=tuple(map(joint, robot.joints)),
        motor_table=tuple(map(motor, robot.motor_table)),
        parts={one.name(key): part(old) for key, old in robot.parts.items()},
        markers={one.name(key): marker(old) for key, old in robot.markers.items()},
        shapes=tuple(map(shape, robot.shapes)),
        clauses=tuple(map(clause, robot.clauses)),
        bodies=tuple(map(body, robot.bodies)),
        visuals=tuple(map(visual, robot.visuals)),
        cameras={one.name(key): camera(old) for key, old in robot.cameras.items()},
        untested={
            frozenset(map(link, pair)): f"{reason} ({one.prefix})" if one.prefix else reason for pair, reason in robot.untested.items()
        },
        where={(kind, own if kind == "clause" else one.name(own)): line for (kind, own), line in robot.where.items()},
    )


def _check_names(bodies: Sequence[Robot]) -> None:
    """Raise InvalidValue if elements of one kind have equal names in two robots."""
    kinds = {
        "parts": [key for body in bodies for key in body.parts],
        "motors": [motor for body in bodies for motor in body.motors],
        "joints": [joint.name for body in bodies for joint in body.joints],
        "links": [bodies[0].links[0], *(link for body in bodies for link in body.links[1:])],
        "markers": [key for body in bodies for key in body.markers],
        "shapes": [shape.name for body in bodies for shape in body.shapes],
        "cameras": [key for body in bodies for key in body.cameras],
    }
    for kind, names in kinds.items():
        twice = [name for name, count in Counter(names).items() if count > 1]
        if twice:
            raise InvalidValue(f"two {kind} of the joined robots have the name {twice[0]!r}. Give each robot its own name")


def _pose(key: str, place: tuple[ArrayLike, ArrayLike]) -> tuple[Array, Array]:
    if not isinstance(place, tuple | list) or len(place) != 2:
        raise InvalidValue(f"place of robot {key!r} is no pair. Give (position, rotation): 3 numbers in metres, and a matrix (3, 3).")
    at, turn = (real_array(f"place of robot {key!r}: {what}", given) for what, given in zip(("position", "rotation"), place, strict=True))
    if at.shape != (3,) or not np.isfinite(at).all():
        raise InvalidValue(f"place of robot {key!r}: position has shape {at.shape}; give 3 finite numbers in metres.")
    if turn.shape != (3, 3) or not np.abs(turn @ turn.T - np.eye(3)).max() < 1e-6 or np.linalg.det(turn) < 0:
        raise InvalidValue(f"place of robot {key!r}: rotation is not a right-handed rotation matrix (3, 3).")
    return at, turn
