"""The sigmoid that bounds a force (thesis eq. 5.8): L(v) = m v / (m/k + |v|), maximum m, slope k at 0.  Compiled."""

from __future__ import annotations

import math

from mobee.engine.compiled import inner_exact
from mobee.robot.robot import Array


@inner_exact
def squash(v: float, maximum: float, slope: float) -> float:
    """One dimension (eq. 5.8); `maximum` in the unit of the result, `slope` in that unit per unit of v."""
    return maximum * v / (maximum / slope + abs(v))


@inner_exact
def squash_norm(v: Array, first: int, stop: int, maximum: float, slope: float) -> None:
    """Bound the Euclidean norm of v[first:stop] and keep its direction."""
    length = norm(v, first, stop)
    for i in range(first, stop):
        v[i] = maximum * v[i] / (maximum / slope + length)


@inner_exact
def norm(v: Array, first: int, stop: int) -> float:
    """The Euclidean norm of v[first:stop]."""
    squares = 0.0
    for i in range(first, stop):
        squares += v[i] * v[i]
    return math.sqrt(squares)
