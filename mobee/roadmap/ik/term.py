"""A term of the cost of a pose (thesis eqs. 3.1-3.3), also from a user's function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.pose import Pose
from mobee.robot.robot import Robot

Residual = Callable[[Pose], Array]

PER_METRE, PER_RAD = 20.0, 2.0  # weights
METRES, RADIANS = 0.005, float(np.deg2rad(5.0))  # tolerances
UPRIGHT = np.eye(3)  # the frame of an aim that needs none


@dataclass(frozen=True, slots=True, eq=False)
class Aim:
    """What least squares takes a term for: a kind, two links (0: the root frame), a point and a frame on each, a length [m], a motor.

    See `mobee.roadmap.ik.aims`.
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
    """One h_i: a name, what is missing of it, what that costs, and how much may be missing.

    `residual`: of a batch of poses q (N, n), (N,) numbers of at least 0; the cost is weight * residual.  `tolerance`: None for what
    shall only be small.  `aims`: the same for least squares; None where it has no derivative.
    """

    name: str
    residual: Residual
    weight: float
    tolerance: float | None
    aims: Callable[[Robot], tuple[Aim, ...]] | None = None


def checked_term(
    name: str, residual: Residual, weight: float, tolerance: float | None, aims: Callable[[Robot], tuple[Aim, ...]] | None = None
) -> Term:
    """A term whose weight and tolerance make sense; raises InvalidValue."""
    if not (np.isfinite(weight) and weight > 0.0):
        raise InvalidValue(f"weight of {name!r} is {weight!r}; it must be finite and above 0.")
    if tolerance is not None and not (np.isfinite(tolerance) and tolerance >= 0.0):
        raise InvalidValue(f"tolerance of {name!r} is {tolerance!r}; it must be finite and at least 0, or None.")
    return Term(name, residual, weight, tolerance, aims)


def direction_frame(direction: Array) -> Array:
    """What an aim takes for a direction: the first three numbers count."""
    return np.concatenate([direction, np.zeros(6)])


Plain = Callable[..., ArrayLike]


class Function:
    """Calls a user's function with all poses of a batch and their table of contacts, or pose by pose with a tuple of contacts.

    `contacts`: False for a function of the pose alone.
    Which of the two it was written for is found out at the first call: batches that give what the poses give one by one.
    """

    def __init__(self, function: Plain, contacts: bool = True) -> None:
        self._function = function
        self._contacts = contacts
        self._takes_batches: bool | None = None

    def __call__(self, pose: Pose) -> Array:
        """What it says of the poses q (N, n), (N,)."""
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
        felt = () if not self._contacts else (pose.contacts,) if single else (pose.table,)
        return np.asarray(self._function(pose, *felt), dtype=np.float64)

    def _agrees(self, pose: Pose, singly: Array) -> bool:
        try:
            together = self._called(pose, single=False)
        except Exception:  # whatever it raises: it has just worked pose by pose, so it was written for one pose
            return False
        return together.shape == singly.shape and np.allclose(together, singly, rtol=1e-9, atol=1e-12, equal_nan=True)
