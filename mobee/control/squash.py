"""The sigmoid that bounds a force (thesis eq. 5.8): L(v) = m v / (m/k + |v|), maximum m, slope k at 0."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array


def squash(v: Array, maximum: Array | float, slope: Array | float) -> Array:
    """Bound every dimension by itself; the direction of v is not preserved (thesis eq. 5.8).

    `v`: (..., n); `maximum` in the unit of the result, `slope` in that unit per unit of v, both scalar or (n,).
    """
    return maximum * v / (maximum / slope + np.abs(v))


def squash_norm(v: Array, maximum: float, slope: float) -> Array:
    """Bound the Euclidean norm of v (..., n) over its last axis and keep its direction."""
    norm = np.sqrt((v * v).sum(axis=-1, keepdims=True))
    squashed: Array = maximum * v / (maximum / slope + norm)
    return squashed
