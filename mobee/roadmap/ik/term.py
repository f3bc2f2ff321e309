"""A term of the cost of a pose (thesis eqs. 3.1-3.3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mobee.errors import InvalidValue
from mobee.pose import Pose
from mobee.robot.robot import Array, Robot

Residual = Callable[[Pose], Array]

PER_METRE, PER_RAD = 20.0, 2.0  # weights
METRES, RADIANS = 0.005, float(np.deg2rad(5.0))  # tolerances
UPRIGHT = np.eye(3)  # the frame of an aim that needs none


@dataclass(frozen=True, slots=True, eq=False)
class Aim:
    """What least squares takes a term for: a kind, two links (0: the root frame), a point and a frame on each, a length [m], a motor.

    See `mobee.roadmap.ik.aim_kinds`.
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
