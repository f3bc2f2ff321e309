"""Which motor drives each joint, for formats with one motor a joint."""

from __future__ import annotations

from dataclasses import dataclass

from mobee.errors import InvalidValue
from mobee.robot.robot import Robot


@dataclass(frozen=True, slots=True)
class Drive:
    """Joint = scale * motor + offset."""

    motor: int
    scale: float
    offset: float  # rad or m


def drives_of(robot: Robot) -> tuple[Drive, ...]:
    """The drive of every joint; raises InvalidValue for a joint that no motor drives, or more than one."""
    drives: dict[int, Drive] = {}
    for column, motor in enumerate(robot.motor_table):
        for index, scale, offset in motor.joints:
            if index in drives:
                joint = robot.joints[index].name
                both = f"{robot.motors[drives[index].motor]!r} and {motor.name!r}"
                raise InvalidValue(f"joint {joint!r} is driven by {both}. Make two joints of it, on the same axis, one for each motor.")
            drives[index] = Drive(column, scale, offset)
    for index, idle in enumerate(robot.joints):
        if index not in drives:
            raise InvalidValue(f"joint {idle.name!r} is driven by no motor. Give it one, or make it part of the link that carries it.")
    return tuple(drives[index] for index in range(len(robot.joints)))
