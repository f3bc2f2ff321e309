# SPDX-License-Identifier: Apache-2.0
"""The unit of each motor's position in the control law, and the motor's limit zones.

The control law computes with angles. A motor that slides has no angle, so its whole range counts as the angle SLIDE_RANGE (200 deg): 1 rad
is then range / SLIDE_RANGE of its own unit, the metre of a URDF. In this unit a slide of 4 cm and one of 2 m behave in the same manner.

Three quantities use a smaller unit for slides, FINE (0.25) times the unit of the law: the thresholds for rest, backlash, and encoder noise.
With the unit of the law itself, a slide with a range of 35 cm would count as at rest when it is still 2 mm from its goal.
"""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.robot.robot import Motor, Robot, per_robot

SLIDE_RANGE = np.deg2rad(200.0)  # rad, which the range of a slide counts as: LIMIT_WIDTH is then 5 % of it
LIMIT_WIDTH = np.deg2rad(10.0)  # rad: the limit zone of the shipped gains
FINE = 0.25  # of the unit of the law: slides of up to half a metre then settle within 1 mm
WIDEST = 0.25  # of a motor's range: the widest limit zone, so that a narrow range keeps its middle


def slides(robot: Robot, motor: Motor) -> bool:
    """Return whether the motor moves prismatic joints only."""
    return bool(motor.joints) and all(robot.joints[joint].kind == "prismatic" for joint, _, _ in motor.joints)


def in_metres(robot: Robot, motor: Motor) -> bool:
    """Return whether the position of a motor is in m: it moves prismatic joints only, and one of them exactly as far as itself."""
    return slides(robot, motor) and any(abs(scale) == 1.0 for _, scale, _ in motor.joints)


def unit_name(robot: Robot, motor: Motor) -> str:
    """Return the name of the unit of the motor's position: "m" if it is in metres (`in_metres`), else "rad"."""
    return "m" if in_metres(robot, motor) else "rad"


def angle_unit(limits: Array, sliding: bool) -> float:
    """Return the motion of a motor, in its own unit, that counts as 1 rad in the control law.

    `limits`: (2,) rad or m. `sliding`: whether the motor is a slide, that is, moves prismatic joints only. The result is 1 for a motor that
    turns, and range / SLIDE_RANGE [m] for a slide, so that the whole range of a slide counts as SLIDE_RANGE (200 deg).
    """
    span = float(limits[1] - limits[0])
    return span / SLIDE_RANGE if sliding and 0.0 < span < np.inf else 1.0


@per_robot
def motor_units(robot: Robot) -> Array:
    """Return for each motor the distance, in its own unit, that the control law treats as 1 rad, (n,), read-only.

    It is 1 rad for a motor that turns, and a length [m] for a slide, as in `mobee.robot.motor_units.angle_unit`.
    """
    units = np.array([angle_unit(motor.limits, slides(robot, motor)) for motor in robot.motor_table])
    units.flags.writeable = False
    return units


@per_robot
def fine_units(robot: Robot) -> Array:
    """Return for each motor the distance, in its own unit, that counts as 1 rad where a quantity is small, (n,), read-only.

    Small quantities are the thresholds for rest, the backlash and the encoder noise. The distance is 1 rad for a motor that turns, and for
    a slide FINE (0.25) times the length [m] of `mobee.robot.motor_units.motor_units`.
    """
    units = np.array(
        [unit * (FINE if slides(robot, motor) else 1.0) for unit, motor in zip(motor_units(robot), robot.motor_table, strict=True)]
    )
    units.flags.writeable = False
    return units


def limit_zones(robot: Robot, width: Array) -> Array:
    """Return the widths of the zones at the lower and the upper limit of each motor, (n, 2), in the unit of the motor.

    In a zone the control law pushes inward. `width` (n,): the gain `limit_width`, in the unit of the motor. A zone is at most WIDEST (1/4)
    of the motor's range. If the motor's `zone_ends_at_home` is set, a zone that would include the home position ends there.
    """
    low, high = robot.limits.T
    widest = np.minimum(width, WIDEST * (high - low))
    zones = np.stack([widest, widest], axis=1)
    for row, motor in zip(zones, robot.motor_table, strict=True):
        if motor.zone_ends_at_home:
            row[:] = np.minimum(row, np.maximum([motor.home - motor.limits[0], motor.limits[1] - motor.home], 0.0))
    return zones


def outside_zones(wanted: float, limits: Array, unit: float) -> float:
    """Return the position nearest to `wanted` that is in neither of the motor's two limit zones.

    A zone is a range beside a limit, in which the control law pushes the motor inward. Here it has the width of the default gains: 10
    degrees times `unit`, but at most 1/4 of the range. `wanted`, `limits` (2,) and the result are in the motor's own unit, rad or m.
    `unit`: the motion of the motor that counts as 1 rad.
    """
    zone = min(LIMIT_WIDTH * unit, WIDEST * float(limits[1] - limits[0]))
    return float(np.clip(wanted, limits[0] + zone, limits[1] - zone))
