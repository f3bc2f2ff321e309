# SPDX-License-Identifier: Apache-2.0
"""Terms of the cost of a pose (thesis eqs. 3.1-3.3), and their residuals in the form that least squares needs."""

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
    """A residual for least squares, in the form that the compiled core reads.

    Attributes:
        kind: one of the constants KINDS: PLACE (the two points coincide), TURNED (the two frames are parallel), ALONG (the two directions
            are equal), HOLD (the points are at the distance `length`), FACING (the first direction points to the second point), COORDINATE
            (d . (first point - second point) is `length`; d: the first three numbers of `second_frame`), AT_MOST (this product is at most
            `length`), MOTOR (a motor is at the value `length`).
        first_link: number of the first link; 0: the root frame.
        first_point: (3,) m, in the root frame at the zero pose.
        first_frame: (3, 3), in the root frame at the zero pose; or (9,) with a direction in its first three numbers.
        second_link: number of the second link; 0: the root frame.
        second_point: (3,) m, like `first_point`.
        second_frame: (3, 3) or (9,), like `first_frame`.
        length: a distance or value, m or rad.
        motor: index of the motor, for MOTOR.
    """

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
    """One term h_i of the cost of a pose: weight * residual.

    `residual`: computes numbers (N,), at least 0, from a batch of poses q (N, n). `tolerance`: a pose with a residual up to this value
    meets the term; None if the term is only minimised. `aims`: takes the robot and returns the residuals of this term for least squares;
    None if the term has no derivative.
    """

    name: str
    residual: Residual
    weight: float
    tolerance: float | None
    aims: Callable[[Robot], tuple[Aim, ...]] | None = None


def checked_term(
    name: str, residual: Residual, weight: float, tolerance: float | None, aims: Callable[[Robot], tuple[Aim, ...]] | None = None
) -> Term:
    """Return a term; raise InvalidValue if the weight is not above 0, or the tolerance is below 0 or not finite.

    `residual`: computes numbers (N,), at least 0, from a batch of N poses. `aims`: function of the robot that returns the residuals for
    least squares; None without a derivative.
    """
    if not (np.isfinite(weight) and weight > 0.0):
        raise InvalidValue(f"weight of {name!r} is {weight!r}; it must be finite and above 0.")
    if tolerance is not None and not (np.isfinite(tolerance) and tolerance >= 0.0):
        raise InvalidValue(f"tolerance of {name!r} is {tolerance!r}; it must be finite and at least 0, or None.")
    return Term(name, residual, weight, tolerance, aims)


def direction_frame(direction: Array) -> Array:
    """Return nine numbers, a direction (3,) and six zeros, which replace the frame of an `Aim` that needs only a direction."""
    return np.concatenate([direction, np.zeros(6)])


def directed(marker: Marker, direction: Array, goal: Array) -> Aim:
    """Return the aim (a residual for least squares) that turns a direction of a marker's link to the direction `goal` (3,), root frame.

    `direction`: (3,), fixed to the link, in the root frame at the zero pose.
    """
    return Aim(ALONG, marker.link, marker.position, direction_frame(direction), 0, NOWHERE, direction_frame(goal))


def level(marker: Marker, direction: Array, value: float) -> Aim:
    """Return the aim that makes direction . x equal to `value`, where x is the position of the marker [m], root frame.

    An aim is a residual for least squares. `direction` (3,) may have any length; `value` is in m times this length.
    """
    return Aim(COORDINATE, marker.link, marker.position, UPRIGHT, 0, NOWHERE, direction_frame(direction), value)


def below(marker: Marker, direction: Array, value: float) -> Aim:
    """Return the aim that makes direction . x at most `value`, where x is the position of the marker [m], root frame.

    An aim is a residual for least squares. `direction` (3,) may have any length; `value` is in m times this length.
    """
    return Aim(AT_MOST, marker.link, marker.position, UPRIGHT, 0, NOWHERE, direction_frame(direction), value)


def motor_at(motor: int, value: float) -> Aim:
    """Return the aim (a residual for least squares) that is zero if the motor with the index `motor` is at `value` [rad]."""
    return Aim(MOTOR, 0, NOWHERE, UPRIGHT, 0, NOWHERE, UPRIGHT, value, motor)


Plain = Callable[..., ArrayLike]


class Function:
    """Calls a user's cost function once for a batch of N poses, or once for each pose if the function does not accept a batch.

    The function returns N numbers for a batch, or one number for one pose. Its first argument is the batch or pose. For a batch, its second
    argument is the table of all contacts; for one pose, a tuple of the contacts. The first call tests whether the function accepts a batch,
    that is, returns the same values for it as for the single poses, or fails for single poses and returns N numbers for it. `contacts`:
    False if the function takes only the pose.
    """

    def __init__(self, function: Plain, contacts: bool = True) -> None:
        self._function = function
        self._contacts = contacts
        self._takes_batches: bool | None = None

    def __call__(self, pose: Pose) -> Array:
        """Return the values (N,) of the function in the N poses of the batch `pose`."""
        if self._takes_batches is None:
            try:
                singly = self._singly(pose)
            except Exception:  # of any kind: the function may have been written for a batch only
                together = self._batched(pose)
                if together is None:
                    raise
                self._takes_batches = True
                return together
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

    def _batched(self, pose: Pose) -> Array | None:
        """Return the values (N,) of one call with the batch; None if the function does not accept a batch."""
        try:
            together = self._called(pose, single=False)
        except Exception:  # of any kind: the function may have been written for one pose
            return None
        return together if together.shape == (len(pose.q),) else None

    def _agrees(self, pose: Pose, singly: Array) -> bool:
        together = self._batched(pose)
        return together is not None and np.allclose(together, singly, rtol=1e-9, atol=1e-12, equal_nan=True)
