# SPDX-License-Identifier: Apache-2.0
"""Replaces the largest torques of a robot's motors, which its file states, by given values, for example smaller ones for the fingers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from fnmatch import fnmatchcase

from mobee.errors import UnknownName
from mobee.robot.robot import Robot


def with_torques(robot: Robot, torques: Mapping[str, float]) -> Robot:
    """Return a copy of the robot in which some motors have a new largest torque.

    `torques`: torque [N m] by pattern of motor names, such as "?_thumb_*"; the first pattern that matches a motor counts. Raises
    UnknownName for a pattern that matches no motor.
    """
    for pattern in torques:
        if not any(fnmatchcase(name, pattern) for name in robot.motors):
            raise UnknownName("motor for a torque", pattern, robot.motors)
    table = [
        replace(
            motor, max_torque=next((torque for pattern, torque in torques.items() if fnmatchcase(motor.name, pattern)), motor.max_torque)
        )
        for motor in robot.motor_table
    ]
    return replace(robot, motor_table=tuple(table))
