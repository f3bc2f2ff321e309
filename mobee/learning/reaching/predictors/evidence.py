"""The parameters of the covariance under which the rewards seen are most likely."""

from __future__ import annotations

import numpy as np

from mobee.learning.reaching.predictors.covariance import Covariance, points, usual
from mobee.learning.reaching.predictors.linear_arm import LinearArm
from mobee.learning.reaching.predictors.reached import Reached
from mobee.robot.robot import Array

MOST = 500  # pairs that are looked at: time grows with their cube
DOUBT = 1.0  # standard deviation of the logarithm of a parameter around its usual value
STEPS = 40  # of the search at most


def surprise(logs: Array, arm: LinearArm, squares: Array, reached: Reached, expected: Array) -> tuple[float, Array]:
    """Minus the logarithm of the evidence and of how usual the parameters are, but for a constant, and its derivatives (P,).

    `expected`: (n,), what the pairs were to bring before anything was seen.  Their rewards enter by their average and their scatter,
    which is the same as each of them.
    """
    from scipy.linalg import cho_factor, cho_solve

    chosen = np.unique(np.linspace(0, len(reached) - 1, min(len(reached), MOST)).round().astype(np.intp))
    seen = points(arm, reached.state[chosen], reached.places[reached.target[chosen]])
    covariance = Covariance(squares, logs)
    matrix, slopes = covariance.with_slopes(seen, reached.count[chosen])
    factor = cho_factor(matrix, lower=True, overwrite_a=True, check_finite=False)
    residual = (reached.mean - expected)[chosen]
    weight = cho_solve(factor, residual, check_finite=False)
    inverse = cho_solve(factor, np.eye(len(chosen)), check_finite=False)
    repeats, scatter, noise = reached.tries - len(reached), reached.scatter, covariance.noise
    unusual = (logs - usual(arm.reaches)) / DOUBT
    value = 0.5 * residual @ weight + np.log(factor[0].diagonal()).sum()
    value += 0.5 * (repeats * np.log(noise) + scatter / noise) + 0.5 * unusual @ unusual
    slope = 0.5 * slopes(inverse - weight[:, None] * weight) + unusual / DOUBT
    slope[0] += 0.5 * (repeats - scatter / noise)
    return float(value), slope


def most_likely(logs: Array, arm: LinearArm, squares: Array, reached: Reached, expected: Array) -> Array:
    """Logarithms of the parameters, searched from `logs` (P,)."""
    from scipy.optimize import minimize

    bounds = [(middle - 4.0 * DOUBT, middle + 4.0 * DOUBT) for middle in usual(arm.reaches)]
    found = minimize(
        surprise, logs, (arm, squares, reached, expected), jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": STEPS}
    )
    best: Array = found.x
    return best
