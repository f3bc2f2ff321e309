"""A term of the cost of a pose (thesis eqs. 3.1-3.3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mobee.pose import Pose
from mobee.robot.robot import Array, Robot

Residual = Callable[[Pose], Array]


@dataclass(frozen=True, slots=True, eq=False)
class Aim:
    """What least squares takes a term for, see `aims`: a kind, two links (0: the root frame), a point and a frame on each, a length [m]."""

    kind: int
    first_link: int
    first_point: Array
    first_frame: Array
    second_link: int
    second_point: Array
    second_frame: Array
    length: float = 0.0


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
