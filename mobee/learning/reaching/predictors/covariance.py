# SPDX-License-Identifier: Apache-2.0
"""The covariance function of the Gaussian process over reaches (pulls of the hand towards a target), and the fit of its parameters.

The covariance of the mean rewards of two reaches has four parts: for similar poses and near targets ("place"), for similar poses and
similar vectors from hand to target ("approach"), for similar remaining distances in any poses ("distance"), and a small part for all
reaches ("offset").
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.reaching.predictors.linear_arm import LinearArm
from mobee.learning.reaching.predictors.observed import Reached
from mobee.learning.reaching.predictors.worlds import ONE_WORLD, scales_of
from mobee.learning.reaching.reaches import Reaches

OFFSET = 0.3**2  # variance of the common part of all rewards
DEFAULTS = {  # variances of rewards, which are in [0, 1], and lengths in m
    "noise": 0.05**2,
    "place": 0.2**2,
    "place length": 0.15,
    "approach": 0.2**2,
    "approach length": 0.10,
    "approach joints": 2.0,  # times the lengths of the joints
    "distance": 0.2**2,
    "distance length": 0.10,
}
DEFAULT_JOINT = 0.5  # length scale of each joint, in units of the spread of the samples
Slopes = Callable[[Array], Array]
_NOISE, _PLACE, _PLACE_L, _APPROACH, _APPROACH_L, _APPROACH_J, _DISTANCE, _DISTANCE_L, _JOINTS = range(9)


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """The features of n reaches that the covariance function needs.

    `state`: (n,) number of the state in which each reach starts. `target`: (n, 3) m, root frame. `vector`: (n, 3) m, from the hand to the
    target. `remaining`: (n,) m, the distance that remains after the reach, as `LinearArm` (a linear arm with springs) predicts it.
    """

    state: Ints
    target: Array
    vector: Array
    remaining: Array


def points(arm: LinearArm, state: Ints, target: Array) -> Points:
    """Return the features of reaches from states (n,) for targets (n, 3) [m], or for one target (3,) [m], root frame.

    `arm`: predicts the distances that remain after the reaches, and has the positions of the hand in the states.
    """
    targets = np.broadcast_to(target, (len(state), 3))
    vector = targets - arm.reaches.hands[state]
    return Points(state, targets, vector, arm.remaining(state, vector))


def default_parameters(reaches: Reaches) -> Array:
    """Return the logarithms of the covariance parameters before the first fit, shape (8 + d,).

    First come the parameters in `DEFAULTS` (variances of rewards, and lengths in m), then one length for each joint, in units of the spread
    of its samples (largest minus smallest).
    """
    return np.log([*DEFAULTS.values(), *[DEFAULT_JOINT] * reaches.samples.shape[1]])


def joint_squares(reaches: Reaches) -> Array:
    """Return for each joint the squared differences between the samples of all pairs of states, shape (d, S, S).

    The sample of a state is the pose of the d joints at which its reaches begin. The positions of each joint are first divided by their
    spread (largest minus smallest).
    """
    scaled = (reaches.samples / np.maximum(np.ptp(reaches.samples, axis=0), 1e-9)).T
    squares: Array = (scaled[:, :, None] - scaled[:, None, :]) ** 2
    return squares


class Covariance:
    """The covariance function of the mean rewards of reaches, for given parameters.

    Args:
        squares: (d, S, S) scaled squared differences of d joints between S states, from `joint_squares`.
        logs: (8 + d,) logarithms of the parameters, in the order of `default_parameters`.
    """

    def __init__(self, squares: Array, logs: Array) -> None:
        self.logs = logs
        self._squares = squares
        self._value = np.exp(logs)
        lengths = self._value[_JOINTS:]
        far = np.tensordot(lengths**-2.0, squares, 1)
        self._by_place = self._value[_PLACE] * np.exp(-0.5 * far)
        self._by_approach = self._value[_APPROACH] * np.exp(-0.5 * far / self._value[_APPROACH_J] ** 2)

    @property
    def noise(self) -> float:
        """The variance of one reward around the mean reward of its reach."""
        return float(self._value[_NOISE])

    @property
    def prior(self) -> float:
        """The variance of the mean reward of a reach before any reach was observed."""
        return float(OFFSET + self._value[[_PLACE, _APPROACH, _DISTANCE]].sum())

    def between(self, a: Points, b: Points) -> Array:
        """Return the covariances of the mean rewards of n reaches `a` and m reaches `b`, shape (n, m)."""
        pair = np.ix_(a.state, b.state)
        place = self._by_place[pair] * np.exp(_squared(a.target, b.target) * (-0.5 / self._value[_PLACE_L] ** 2))
        approach = self._by_approach[pair] * np.exp(_squared(a.vector, b.vector) * (-0.5 / self._value[_APPROACH_L] ** 2))
        distance = np.exp((a.remaining[:, None] - b.remaining) ** 2 * (-0.5 / self._value[_DISTANCE_L] ** 2))
        total: Array = place + approach + self._value[_DISTANCE] * distance + OFFSET
        return total

    def with_slopes(self, a: Points, count: Array, scales: Array) -> tuple[Array, Slopes]:
        """Return the covariance (n, n) of the average rewards of n reaches, and a function that computes its derivatives.

        `a`: the reaches. `count`: (n,) number of tries over which the reward of each reach is averaged. `scales`: (n, n) factors on the
        covariances of the mean rewards; 1, or more for two reaches in the same earlier world (`worlds.scales_of`). The function takes
        weights (n, n). It returns the derivatives (8 + d,) of the sum of weights times covariance by the logarithms of the parameters.
        """
        value, pair = self._value, np.ix_(a.state, a.state)
        place_far = _squared(a.target, a.target) / value[_PLACE_L] ** 2
        approach_far = _squared(a.vector, a.vector) / value[_APPROACH_L] ** 2
        distance_far = (a.remaining[:, None] - a.remaining) ** 2 / value[_DISTANCE_L] ** 2
        place, approach = self._by_place[pair] * np.exp(-0.5 * place_far), self._by_approach[pair] * np.exp(-0.5 * approach_far)
        distance = value[_DISTANCE] * np.exp(-0.5 * distance_far)
        joints = [squares[pair] / length**2 for squares, length in zip(self._squares, value[_JOINTS:], strict=True)]

        def slopes(weights: Array) -> Array:
            """Return the derivatives of the sum of weights (n, n) times the covariance by the logarithms of the parameters."""
            noise = (weights.diagonal() / count).sum() * value[_NOISE]
            weights = weights * scales
            by_place, by_approach, by_distance = weights * place, weights * approach, weights * distance
            narrower = by_approach / value[_APPROACH_J] ** 2
            by_joint = [float((by_place * far).sum()) for far in joints]
            by_joint_too = [float((narrower * far).sum()) for far in joints]
            return np.array(
                [
                    noise,
                    by_place.sum(),
                    (by_place * place_far).sum(),
                    by_approach.sum(),
                    (by_approach * approach_far).sum(),
                    sum(by_joint_too),
                    by_distance.sum(),
                    (by_distance * distance_far).sum(),
                    *np.add(by_joint, by_joint_too),
                ]
            )

        return (place + approach + distance + OFFSET) * scales + np.diag(value[_NOISE] / count), slopes


def _squared(a: Array, b: Array) -> Array:
    """Return squared distances between rows, shape (a, b); exactly 0 for the same row."""
    gap: Array = a[:, 0, None] - b[:, 0]
    total = gap * gap
    for axis in range(1, a.shape[1]):
        gap = a[:, axis, None] - b[:, axis]
        total += gap * gap
    return total


MAX_FITTED = 500  # pairs used in the fit: time grows with their cube
PRIOR_DEVIATION = 1.0  # of the logarithm of a parameter around its default
MAX_STEPS = 40  # of the search


def fitted_pairs(reached: Reached) -> Ints:
    """Return the indices, ascending, of the pairs of state and target that a fit uses: at most MAX_FITTED (500).

    Pairs of the newest world (the surroundings and the robot of the newest reaches) are chosen first; pairs of all other worlds fill the
    remaining number. If one of these two groups has too many pairs, evenly spaced ones are chosen from it, in the order of their first
    reaches.
    """
    newest = reached.world == reached.world.max(initial=0)
    chosen: list[Ints] = []
    for group in (np.flatnonzero(newest), np.flatnonzero(~newest)):
        number = min(len(group), MAX_FITTED - sum(map(len, chosen)))
        chosen.append(group[np.unique(np.linspace(0, len(group) - 1, number).round().astype(np.intp))])
    return np.sort(np.concatenate(chosen))


def negative_log_posterior(
    logs: Array, arm: LinearArm, squares: Array, reached: Reached, expected: Array, factors: Array = ONE_WORLD
) -> tuple[float, Array]:
    """Return the negative log posterior of the covariance parameters, up to a constant, and its derivatives (8 + d,).

    It is the negative logarithm of the evidence (marginal likelihood) of the rewards times the prior of the parameters. The average reward
    of each pair of state and target and the scatter around it are used, which is equivalent to using every reward. If there are more than
    500 pairs, the averages of only 500 are used.

    Args:
        logs: (8 + d,) logarithms of the parameters.
        arm: gives the features of the reaches (`points`).
        squares: (d, S, S) scaled squared differences of d joints between S states, from `joint_squares`.
        reached: the n pairs of state and target that were tried, with their rewards.
        expected: (n,) prior mean reward of each pair.
        factors: (W,) for each of W worlds (in which reaches were made) how much its rewards differ from those of the present one, 0: not at
            all; see `worlds.scales_of`.
    """
    from scipy.linalg import cho_factor, cho_solve

    chosen = fitted_pairs(reached)
    seen = points(arm, reached.state[chosen], reached.places[reached.target[chosen]])
    covariance = Covariance(squares, logs)
    matrix, slopes = covariance.with_slopes(seen, reached.count[chosen], scales_of(reached.world[chosen], factors))
    factor = cho_factor(matrix, lower=True, overwrite_a=True, check_finite=False)
    residual = (reached.mean - expected)[chosen]
    weight = cho_solve(factor, residual, check_finite=False)
    inverse = cho_solve(factor, np.eye(len(chosen)), check_finite=False)
    repeats, scatter, noise = reached.tries - len(reached), reached.scatter, covariance.noise
    deviation = (logs - default_parameters(arm.reaches)) / PRIOR_DEVIATION
    value = 0.5 * residual @ weight + np.log(factor[0].diagonal()).sum()
    value += 0.5 * (repeats * np.log(noise) + scatter / noise) + 0.5 * deviation @ deviation
    slope = 0.5 * slopes(inverse - weight[:, None] * weight) + deviation / PRIOR_DEVIATION
    slope[0] += 0.5 * (repeats - scatter / noise)
    return float(value), slope


def fitted_parameters(logs: Array, arm: LinearArm, squares: Array, reached: Reached, expected: Array, factors: Array = ONE_WORLD) -> Array:
    """Return the logarithms of the covariance parameters with the highest posterior, (8 + d,), by a local search.

    `logs`: (8 + d,), where the search begins, for d joints. `arm`: gives the features of the reaches (`points`). `squares`: (d, S, S) for S
    states, from `joint_squares`. `reached`: the n pairs of state and target that were tried, with their rewards. `expected`: (n,) prior
    mean reward of each pair. `factors`: (W,) for each of W worlds (in which reaches were made) how much its rewards differ from those of
    the present one, 0: not at all; see `worlds.scales_of`.
    """
    from scipy.optimize import minimize

    bounds = [(middle - 4.0 * PRIOR_DEVIATION, middle + 4.0 * PRIOR_DEVIATION) for middle in default_parameters(arm.reaches)]
    found = minimize(
        negative_log_posterior,
        logs,
        (arm, squares, reached, expected, factors),
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": MAX_STEPS},
    )
    best: Array = found.x
    return best
