"""The unit of each motor in the control law, and its limit zones.

The numbers of the law are angles.  A motor that slides has no angle, so its whole range counts as one, SLIDE_RANGE: an angle of 1 rad
is then range / SLIDE_RANGE of its own unit, the metre of a URDF.  In this unit a slide of 4 cm and one of 2 m behave alike.

What says how exact a motor is (when it counts as at rest, its play, its noise) counts FINE of that for a slide.  In the unit of the
law alone a lift of 35 cm would count as at rest 2 mm before its goal.
"""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.robot.robot import Motor, Robot, per_robot

SLIDE_RANGE = np.deg2rad(200.0)  # rad: LIMIT_WIDTH is then 5 % of a slide's range
LIMIT_WIDTH = np.deg2rad(10.0)  # rad: the limit zone of the shipped gains
FINE = 0.25  # so that slides of up to half a metre settle within 1 mm
WIDEST = 0.25  # of a motor's range is the most that one limit zone may take, so that a narrow range keeps its middle


def slides(robot: Robot, motor: Motor) -> bool:
    """Whether the motor moves prismatic joints only."""
    return bool(motor.joints) and all(robot.joints[joint].kind == "prismatic" for joint, _, _ in motor.joints)


def angle_unit(limits: Array, sliding: bool) -> float:
    """What 1 rad of the law is in the unit of a motor with these limits (2,): 1 where it turns, [m] where it slides."""
    span = float(limits[1] - limits[0])
    return span / SLIDE_RANGE if sliding and 0.0 < span < np.inf else 1.0


@per_robot
def motor_units(robot: Robot) -> Array:
    """What 1 rad of the law is in the unit of each motor, shape (n,): 1 for motors that turn, see `angle_unit`."""
    units = np.array([angle_unit(motor.limits, slides(robot, motor)) for motor in robot.motor_table])
    units.flags.writeable = False
    return units


@per_robot
def fine_units(robot: Robot) -> Array:
    """What 1 rad of a threshold of rest, of play or of noise is in the unit of each motor, shape (n,): 1 for motors that turn."""
    units = np.array(
        [unit * (FINE if slides(robot, motor) else 1.0) for unit, motor in zip(motor_units(robot), robot.motor_table, strict=True)]
    )
    units.flags.writeable = False
    return units


def limit_zones(robot: Robot, width: Array) -> Array:
    """How far from its lower and from its upper limit the law pushes each motor inward, shape (n, 2), in the unit of the motor.

    `width` (n,): the zone that the gains ask for.  A zone takes at most WIDEST of the range; where the motor's zones end at home
    (see `Motor`) it reaches no farther than there.
    """
    low, high = robot.limits.T
    widest = np.minimum(width, WIDEST * (high - low))
    zones = np.stack([widest, widest], axis=1)
    for row, motor in zip(zones, robot.motor_table, strict=True):
        if motor.zone_ends_at_home:
            row[:] = np.minimum(row, np.maximum([motor.home - motor.limits[0], motor.limits[1] - motor.home], 0.0))
    return zones


def outside_zones(wanted: float, limits: Array, unit: float) -> float:
    """The position nearest to the wanted one that lies outside the limit zones of the shipped gains, in the unit of the motor."""
    zone = min(LIMIT_WIDTH * unit, WIDEST * float(limits[1] - limits[0]))
    return float(np.clip(wanted, limits[0] + zone, limits[1] - zone))
