"""How the shape of a search distribution follows a generation: natural gradients through the exponential map.

A shape is B of x = mean + sigma B z, a matrix (d, d), or its diagonal (d,).  The exponential of a symmetric matrix is positive
definite whatever its weights, so nothing is ever repaired or decomposed.
"""

from __future__ import annotations

import math

import numpy as np

from mobee.robot.robot import Array

_NEGLIGIBLE = 1e-17


def turned(shape: Array, z: Array, weights: Array, shrink: float) -> Array:
    """B exp(1/2 (sum_i weights_i z_i z_i^T - shrink I)), exact to rounding; z (k, d), weights (k,).

    The sum has no more than k directions of its own, so where k < d the series is one of matrices (k, k).
    """
    if shape.ndim == 1:
        diagonal: Array = shape * np.exp(0.5 * (weights @ z**2 - shrink))
        return diagonal
    weighted = z * (0.5 * weights)[:, None]
    if len(z) < len(shape):
        change = (shape @ z.T) @ (_series(weighted @ z.T) @ weighted)
    else:
        exponent = weighted.T @ z
        change = shape @ (exponent @ _series(exponent))
    whole: Array = math.exp(-0.5 * shrink) * (shape + change)
    return whole


def _series(a: Array) -> Array:
    """(exp(a) - 1) / a by Taylor's series; the exponents of a generation are small."""
    norm, size, power = math.sqrt(float((a * a).sum())), 1.0, 1
    total = term = np.eye(len(a))
    while size > _NEGLIGIBLE:
        power += 1
        size *= norm / power
        term = term @ a
        term *= 1.0 / power
        total = total + term
    return total


def stretched(shape: Array, z: Array) -> Array:
    """B z of samples (k, d) or of one (d,), of the same form."""
    moved: Array = z * shape if shape.ndim == 1 else z @ shape.T
    return moved
