"""How the shape of a search distribution follows a generation: natural gradients through the exponential map.

A shape is B of x = mean + sigma B z, a matrix (d, d), or its diagonal (d,).  The exponential of a symmetric matrix is positive
definite whatever its weights, so nothing is ever repaired or decomposed.
"""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array

_TERMS = 60  # of a series that ends long before, unless the weights are absurd


def turned(shape: Array, z: Array, weights: Array, shrink: float) -> Array:
    """B exp(1/2 (sum_i weights_i z_i z_i^T - shrink I)), exact to rounding; z (k, d), weights (k,).

    The exponent has no more than k directions of its own, so the series is one of matrices (k, k).
    """
    if shape.ndim == 1:
        diagonal: Array = shape * np.exp(0.5 * (weights @ z**2 - shrink))
        return diagonal
    weighted = z * (0.5 * weights)[:, None]
    small = weighted @ z.T
    total = term = np.eye(len(z))  # of (exp(a) - 1) / a
    for power in range(2, _TERMS):
        term = term @ small / power
        total = total + term
        if np.abs(term).max() < 1e-17:
            break
    whole: Array = np.exp(-0.5 * shrink) * (shape + (shape @ z.T) @ (total @ weighted))
    return whole


def stretched(shape: Array, z: Array) -> Array:
    """B z of samples (k, d) or of one (d,), of the same form."""
    moved: Array = z * shape if shape.ndim == 1 else z @ shape.T
    return moved
