# SPDX-License-Identifier: Apache-2.0
"""Rewards of reaches in several worlds or on several robots: the similarity of the worlds is estimated from the rewards.

A reach pulls the hand towards a target. Its mean reward in an earlier world, or on another robot such as a simulated one, is its mean
reward in the present world plus a difference. The differences of one world are a Gaussian process whose covariance function is that of the
mean rewards, times a factor d. The differences of two worlds are independent. So the covariance of the mean rewards of two reaches is K in
general, and (1 + d) K if both were made in the same earlier world. With d = 0 the rewards of that world count like those of the present
one; the larger d is, the less the rewards of that world inform about the present one.
(Kennedy and O'Hagan 2000 model fast and accurate simulations like this, with another covariance function of the differences.)
"""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array, Ints

ONE_WORLD = np.zeros(1)
"""The factors d if there is only the present world, (1,)."""
FACTORS = (0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)  # values of d, equally probable before any reach


def scales_of(world: Ints, factors: Array) -> Array:
    """Return the numbers (n, n) by which the covariances K of the mean rewards of n reaches are multiplied.

    `world`: (n,) the index of the world of each reach. `factors`: (W,) for each world the factor d of its differences from the present
    world, see the module; 0 for the present one.
    """
    scales: Array = 1.0 + factors[world] * (world[:, None] == world)
    return scales


def fitted_factors(between: Array, noise: Array, residual: Array, world: Ints, factors: Array) -> Array:
    """Return the factors (W,) with the largest evidence (marginal likelihood) of the rewards, by a local search over FACTORS.

    A factor d describes how much a world differs from the present one, see the module.

    Args:
        between: (n, n) covariances K of the mean rewards of n pairs of state and target.
        noise: (n,) variance of the average reward of each pair around its mean.
        residual: (n,) average reward of each pair, minus its prior mean.
        world: (n,) index of the world of each pair, 0 to W - 1.
        factors: (W,) where the search begins, values in FACTORS. The last world is the present one: its factor stays 0.
    """
    from scipy.linalg import cho_factor, cho_solve

    known: dict[tuple[float, ...], float] = {}

    def evidence(trial: tuple[float, ...]) -> float:
        if trial not in known:
            matrix = between * scales_of(world, np.array(trial)) + np.diag(noise)
            factor = cho_factor(matrix, lower=True, overwrite_a=True, check_finite=False)
            known[trial] = -0.5 * residual @ cho_solve(factor, residual, check_finite=False) - np.log(factor[0].diagonal()).sum()
        return known[trial]

    best: tuple[float, ...] = tuple(factors.tolist())
    before: tuple[float, ...] = ()
    while best != before:
        before = best
        for number in np.unique(world[world < len(factors) - 1]).tolist():
            at = FACTORS.index(best[number])
            near = [(*best[:number], factor, *best[number + 1 :]) for factor in FACTORS[max(at - 1, 0) : at + 2]]
            best = max(near, key=evidence)
    return np.array(best)
