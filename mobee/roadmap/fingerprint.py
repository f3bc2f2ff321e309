"""By what a roadmap knows its robot and its world again: their content, to a billionth, however they were made."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from mobee.collision.world import World
from mobee.collision.world_object import WorldObject
from mobee.robot.per_robot import per_robot
from mobee.robot.robot import Robot, Shape

_DIGITS, _DECIMALS = 16, 9


@per_robot
def robot_digest(robot: Robot) -> str:
    """16 hex digits of all that decides which poses a robot has and what touches in them.

    The names of motors and markers count, for costs and tasks speak of them; those of the robot, of its links and of its shapes do
    not, nor does how fast its motors are.
    """
    parts: list[bytes] = [b"robot"]
    for joint in robot.joints:
        parts.append(_bytes(joint.kind, joint.parent, joint.axis, joint.point, joint.limits))
    for motor in robot.motor_table:
        parts.append(_bytes(motor.name, motor.part, motor.limits, motor.home, *(number for drive in motor.joints for number in drive)))
    parts += sorted(_bytes(one.name, one.link, one.position, one.rotation, one.normal) for one in robot.markers.values())
    parts += [_shape(one) for one in robot.shapes]
    for body in robot.bodies:
        parts.append(_bytes(body.link, body.mass, body.centre))
    for clause in robot.clauses:
        parts.append(_bytes(clause.part, clause.a, clause.b))
    parts += [_bytes(np.unique(np.sort(pairs, axis=1), axis=0)) for pairs in (robot.solid_pairs, robot.field_pairs)]
    parts.append(_bytes(np.array(sorted(robot.base_shapes))))
    return _digest(parts)


def world_digest(world: World) -> str:
    """16 hex digits of the objects that can be touched: their volumes, places and roles, and what carries them.

    Neither their names nor their order nor their colours count, and ghosts are not there.
    """
    return _digest([b"world", *sorted(_object(one) for one in world.objects.values() if one.role != "ghost")])


def _shape(shape: Shape) -> bytes:
    vertices = np.empty((0, 3)) if shape.vertices is None else shape.vertices
    return _bytes(shape.kind, shape.role, shape.link, shape.size, shape.position, shape.rotation, vertices)


def _object(thing: WorldObject) -> bytes:
    return _bytes(thing.kind, thing.role, thing.link or "", thing.size, thing.position, thing.rotation)


def _bytes(*values: str | ArrayLike) -> bytes:
    """Text as it is, numbers rounded, each with its length before it."""
    found = [value.encode() if isinstance(value, str) else _rounded(value) for value in values]
    return b"".join(len(one).to_bytes(8, "little") + one for one in found)


def _rounded(value: ArrayLike) -> bytes:
    numbers = np.round(np.asarray(value, dtype=np.float64), _DECIMALS) + 0.0  # no minus zero
    return numbers.astype("<f8").tobytes()


def _digest(parts: Iterable[bytes]) -> str:
    whole = hashlib.sha256()
    for part in parts:
        whole.update(len(part).to_bytes(8, "little") + part)
    return whole.hexdigest()[:_DIGITS]
