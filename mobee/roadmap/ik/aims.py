"""What least squares is to meet, of markers and motors."""

from __future__ import annotations

import numpy as np

from mobee.roadmap.ik.aim_kinds import ALONG, AT_MOST, COORDINATE, MOTOR
from mobee.roadmap.ik.term import UPRIGHT, Aim, direction_frame
from mobee.robot.robot import Array, Marker

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
