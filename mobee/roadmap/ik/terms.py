# SPDX-License-Identifier: Apache-2.0
"""Terms of the cost of a pose (thesis eqs. 3.1-3.3), and the residuals by which least squares meets them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.pose import Pose
from mobee.robot.robot import Marker, Robot

Residual = Callable[[Pose], Array]

PER_METRE, PER_RAD = 20.0, 2.0  # weights
METRES, RADIANS = 0.005, float(np.deg2rad(5.0))  # tolerances
UPRIGHT = np.eye(3)  # the frame of an aim without a frame
NOWHERE = np.zeros(3)  # the point of an aim without a point


# Kinds of residuals, numbered as in core/aims.hpp:
#   PLACE       the two points coincide
#   TURNED      the two frames are parallel
#   ALONG       the two directions are equal
#   HOLD        the points are at a distance of `length`
#   FACING      the first direction points to the second point
#   COORDINATE  the first point is `length` further than the second along a direction of the root frame: the first three numbers of the
#               second frame, of any length themselves
#   AT_MOST     the same, or less
#   MOTOR       a motor is at the value `length`
KINDS = PLACE, TURNED, ALONG, HOLD, FACING, COORDINATE, AT_MOST, MOTOR = tuple(range(8))


@dataclass(frozen=True, slots=True, eq=False)
class Aim:
    """A residual of least squares: its kind, two links (0: the root frame), a point and a frame on each, a length [m], a motor."""

    kind: int
    first_link: int
    first_point: Array
    first_frame: Array
    second_link: int
    second_point: Array
    second_frame: Array
    length: float = 0.0
    motor: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Term:
    """One term h_i of the cost: weight * residual.

    `residual`: computes numbers (N,), 0 or above, from a batch of poses q (N, n).  `tolerance`: largest residual of a pose that is
    reached; None if the term is only minimised.  `aims`: the same term for least squares; None if it has no derivative.
    """

    name: str
    residual: Residual
    weight: float
    tolerance: float | None
    aims: Callable[[Robot], tuple[Aim, ...]] | None = None


def checked_term(
    name: str, residual: Residual, weight: float, tolerance: float | None, aims: Callable[[Robot], tuple[Aim, ...]] | None = None
) -> Term:
    """Return a term; raises InvalidValue if its weight or tolerance is not valid."""
    if not (np.isfinite(weight) and weight > 0.0):
        raise InvalidValue(f"weight of {name!r} is {weight!r}; it must be finite and above 0.")
    if tolerance is not None and not (np.isfinite(tolerance) and tolerance >= 0.0):
        raise InvalidValue(f"tolerance of {name!r} is {tolerance!r}; it must be finite and at least 0, or None.")
    return Term(name, residual, weight, tolerance, aims)


def direction_frame(direction: Array) -> Array:
    """Return a direction (3,) as the nine numbers of an aim's frame: the direction, then zeros."""
    return np.concatenate([direction, np.zeros(6)])


def directed(marker: Marker, direction: Array, goal: Array) -> Aim:
    """Return the aim that turns a direction (3,), fixed to the marker's link (root frame, zero pose), to `goal` (3,), root frame."""
    return Aim(ALONG, marker.link, marker.position, direction_frame(direction), 0, NOWHERE, direction_frame(goal))


def level(marker: Marker, direction: Array, value: float) -> Aim:
    """Return the aim that brings direction . x, x a marker's position, to a value [m times the direction's length]."""
    return Aim(COORDINATE, marker.link, marker.position, UPRIGHT, 0, NOWHERE, direction_frame(direction), value)


def below(marker: Marker, direction: Array, value: float) -> Aim:
    """Return the aim that brings direction . x, x a marker's position, to at most a value [m times the direction's length]."""
    return Aim(AT_MOST, marker.link, marker.position, UPRIGHT, 0, NOWHERE, direction_frame(direction), value)


def motor_at(motor: int, value: float) -> Aim:
    """Return the aim that brings a motor to a value [rad]."""
    return Aim(MOTOR, 0, NOWHERE, UPRIGHT, 0, NOWHERE, UPRIGHT, value, motor)


Plain = Callable[..., ArrayLike]


class Function:
    """Calls a user's function with a batch of poses and their table of contacts, or pose by pose with a tuple of contacts.

    `contacts`: False for a function of the pose alone.
    The first call tests whether the function accepts a batch: it must then return the same values as for single poses.
    """

    def __init__(self, function: Plain, contacts: bool = True) -> None:
        self._function = function
        self._contacts = contacts
        self._takes_batches: bool | None = None

    def __call__(self, pose: Pose) -> Array:
        """Return the values of the function (N,) in poses q (N, n)."""
        if self._takes_batches is None:
            singly = self._singly(pose)
            self._takes_batches = self._agrees(pose, singly)
            return singly
        if not self._takes_batches:
            return self._singly(pose)
        return self._called(pose, single=False)

    def _singly(self, pose: Pose) -> Array:
        found = [self._called(one, single=True) for one in pose.each()]
        if any(value.shape != () for value in found):
            raise InvalidValue(f"a function returned shape {found[0].shape} for one pose; it must return one number.")
        return np.array(found)

    def _called(self, pose: Pose, single: bool) -> Array:
        contacts = () if not self._contacts else (pose.contacts,) if single else (pose.table,)
        return np.asarray(self._function(pose, *contacts), dtype=np.float64)

    def _agrees(self, pose: Pose, singly: Array) -> bool:
        try:
            together = self._called(pose, single=False)
        except Exception:  # of any kind: the function has just worked pose by pose, so it was written for one pose
            return False
        return together.shape == singly.shape and np.allclose(together, singly, rtol=1e-9, atol=1e-12, equal_nan=True)
