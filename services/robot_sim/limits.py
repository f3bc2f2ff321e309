"""What a part's motors may do at most."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Array, Robot


@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """Per motor of a part, each (n,)."""

    lower: Array  # rad
    upper: Array  # rad
    velocity: Array  # rad/s
    acceleration: Array  # rad/s^2
    torque: Array  # N m
    fine: Array  # what 1 rad of a threshold is in the unit of the motor, see mobee.robot.motor_units

    @classmethod
    def of(cls, robot: Robot, part: str) -> Limits:
        """As the robot file says."""
        motors = robot.motor_table[robot.part(part).slice]
        return cls(
            lower=np.array([m.limits[0] for m in motors]),
            upper=np.array([m.limits[1] for m in motors]),
            velocity=np.array([m.max_velocity for m in motors]),
            acceleration=np.array([m.max_acceleration for m in motors]),
            torque=np.array([m.max_torque for m in motors]),
            fine=fine_units(robot)[robot.part(part).slice],
        )
