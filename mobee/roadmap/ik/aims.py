"""Residuals for least squares: their kinds, numbered as in core/aims.hpp."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.roadmap.ik.term import UPRIGHT, Aim, direction_frame
from mobee.robot.robot import Marker

# PLACE: the two points are one.  TURNED: the two frames are parallel.  ALONG: the two directions are one.  HOLD: the points are a length
# apart.  FACING: the first direction points to the second point.  COORDINATE: the first point is a length further than the second in a
# direction of the root frame, the first three numbers of the second frame, of any length itself.  AT_MOST: no further than
# that.  MOTOR: a motor is at a value, the length.
KINDS = PLACE, TURNED, ALONG, HOLD, FACING, COORDINATE, AT_MOST, MOTOR = tuple(range(8))


NOWHERE = np.zeros(3)


def directed(marker: Marker, direction: Array, goal: Array) -> Aim:
    """A direction (3,) that the marker's link carries (root frame, zero pose) points along a direction (3,) of the root frame."""
    return Aim(ALONG, marker.link, marker.position, direction_frame(direction), 0, NOWHERE, direction_frame(goal))


def level(marker: Marker, direction: Array, value: float) -> Aim:
    """A marker is at a value along a direction: direction . x, [m] times its length."""
    return Aim(COORDINATE, marker.link, marker.position, UPRIGHT, 0, NOWHERE, direction_frame(direction), value)


def below(marker: Marker, direction: Array, value: float) -> Aim:
    """A marker is no further than a value along a direction."""
    return Aim(AT_MOST, marker.link, marker.position, UPRIGHT, 0, NOWHERE, direction_frame(direction), value)


def motor_at(motor: int, value: float) -> Aim:
    """A motor is at a value [rad]."""
    return Aim(MOTOR, 0, NOWHERE, UPRIGHT, 0, NOWHERE, UPRIGHT, value, motor)
