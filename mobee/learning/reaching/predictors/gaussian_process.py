# SPDX-License-Identifier: Apache-2.0
"""Gaussian process regression of rewards over poses and targets: the best predictor of this package.

The Cholesky factor of the covariance gets one more row for each reach. The intermediate results of every target for which predictions were
asked are cached. They are always computed in the same blocks of rows, so that predictions depend only on the reaches and not on earlier
queries.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.reaching.histories import forget
from mobee.learning.reaching.predictors.covariance import (
    ONE_WORLD,
    Covariance,
    LinearArm,
    Points,
    default_parameters,
    fitted_factors,
    fitted_pairs,
    fitted_parameters,
    joint_squares,
    points,
    scales_of,
)
from mobee.learning.reaching.predictors.predictor import Reached
from mobee.learning.reaching.reaches import Reaches

BLOCK = 32  # rows
MAX_CACHE = 300e6  # bytes of rows and covariances of queried targets, of one target at least; with 256 states 31 targets or more


class Query:
    """The cached results of Gaussian process regression for one target: intermediate results, and the prediction.

    Arguments: `at`: inputs of the covariance function, for the reaches from all S states for this target. `prior`: (S, S), the covariance
    of their rewards before any reach. `rows`: number of rows to reserve.

    Attributes: `rows`: an array with a row for each observed reach and S columns: the inverse of the Cholesky factor times the covariance
    of observed reaches and states. `upto`: number of rows that are computed. `mean` (S,), a difference from the prior mean, and
    `covariance` (S, S): the prediction from these rows. `done`: number of rows in complete blocks, which are not computed again. `sure`:
    the prediction from the first `done` rows alone, a tuple of mean and covariance.
    """

    def __init__(self, at: Points, prior: Array, rows: int) -> None:
        self.at, self.done, self.upto = at, 0, 0
        self.rows = np.empty((rows, len(prior)))
        self.sure: tuple[Array, Array] = np.zeros(len(prior)), prior  # of the done rows: mean and covariance
        self.mean, self.covariance = self.sure


class Posterior:
    """The posterior of a Gaussian process: mean and covariance of the rewards of reaches from all states for any target.

    Args:
        arm: the linear model of the arm that computes the prior mean of the rewards.
        covariance: the covariance function of the mean rewards.
        state: (n,) state of each pair of state and target that was tried so far.
        target: (n, 3) m, root frame, target of each pair.
        residual: (n,) average reward of each pair, minus its prior mean.
        count: (n,) number of rewards in each average.
        scales: (n, n) factors of the covariances between the pairs: 1 or more for two pairs that were tried in the same earlier world or
            on the same other robot, else 1 (see `covariance.scales_of`).
    """

    def __init__(
        self, arm: LinearArm, covariance: Covariance, state: Ints, target: Array, residual: Array, count: Array, scales: Array
    ) -> None:
        from scipy.linalg import cholesky, solve_triangular

        self._arm, self._covariance, self._solve = arm, covariance, solve_triangular
        self._all = np.arange(len(arm.reaches))
        self._used = len(state)
        size = -(-self._used // BLOCK) * BLOCK + 8 * BLOCK
        self._state, self._target = np.zeros(size, dtype=np.intp), np.zeros((size, 3))
        self._factor, self._score = np.zeros((size, size)), np.zeros(size)
        self._queries: dict[bytes, Query] = {}
        if self._used:
            self._state[: self._used], self._target[: self._used] = state, target
            seen = points(arm, state, target)
            matrix = covariance.between(seen, seen) * scales + np.diag(covariance.noise / count)
            factor = cholesky(matrix, lower=True, overwrite_a=True, check_finite=False)
            self._factor[: self._used, : self._used] = factor
            self._score[: self._used] = self._solve(factor, residual, lower=True, check_finite=False)

    def __len__(self) -> int:
        return self._used

    def about(self, target: Array) -> tuple[Array, Array]:
        """Return the posterior mean (S,) and covariance (S, S) of the mean rewards of all states for a target (3,) m, root frame.

        The posterior mean is given as a difference from the prior mean.
        """
        known = self._updated(target)
        return known.mean, known.covariance

    def append(self, state: int, target: Array, residual: float) -> None:
        """Add one reach.

        `state`: number of the state from which it was made. `target`: (3,) m, root frame. `residual`: its reward minus the prior mean.
        """
        known = self._updated(target)
        row = self._used
        if row == len(self._score):
            self._grow()
        deviation = np.sqrt(max(known.covariance[state, state], 0.0) + self._covariance.noise)
        self._factor[row, :row] = known.rows[:row, state]
        self._factor[row, row] = deviation
        self._score[row] = (residual - known.mean[state]) / deviation
        self._state[row], self._target[row] = state, target
        self._used += 1

    @property
    def _max_queries(self) -> int:
        """Number of targets in the cache: each with its rows, and its covariance twice."""
        states = len(self._all)
        return max(1, int(MAX_CACHE // (8 * states * (len(self._score) + 2 * states))))

    def _updated(self, target: Array) -> Query:
        """Return the cached `Query` of a target (3,) m, root frame; first compute its missing rows (one for each reach)."""
        key = target.tobytes()
        known = self._queries.pop(key, None)
        if known is None:
            at = points(self._arm, self._all, target)
            known = Query(at, self._covariance.between(at, at), len(self._score))
        forget(self._queries, self._max_queries)
        self._queries[key] = known
        if known.upto < self._used:
            if len(known.rows) < self._used:
                known.rows = np.concatenate([known.rows, np.empty((len(self._score) - len(known.rows), len(self._all)))])
            for first in range(known.done, self._used, BLOCK):
                end = min(first + BLOCK, self._used)
                known.mean, known.covariance = self._continued(known, first, end)
                if end - first == BLOCK:
                    known.done, known.sure = end, (known.mean, known.covariance)
            known.upto = self._used
        return known

    def _continued(self, known: Query, first: int, end: int) -> tuple[Array, Array]:
        """Compute the rows `first` to `end` - 1 of a query (one for each reach, see `Query`).

        Returns the posterior mean (S,), as a difference from the prior mean, and covariance (S, S), given the reaches 0 to `end` - 1.
        """
        new = slice(first, end)
        seen = points(self._arm, self._state[new], self._target[new])
        rows = self._covariance.between(seen, known.at)
        rows -= self._factor[new, :first] @ known.rows[:first]
        rows = self._solve(self._factor[new, new], rows, lower=True, overwrite_b=True, check_finite=False)
        known.rows[new] = rows
        mean, covariance = known.sure
        return mean + rows.T @ self._score[new], covariance - rows.T @ rows

    def _grow(self) -> None:
        size = len(self._score) * 3 // 2 // BLOCK * BLOCK
        self._state, self._score = np.resize(self._state, size), np.resize(self._score, size)
        self._target = np.resize(self._target, (size, 3))
        factor = np.zeros((size, size))
        factor[: self._used, : self._used] = self._factor
        self._factor = factor


REFITS = (30, 60, 120, 250, 500, 1000)  # reaches after which the parameters of the covariance are fitted again
COMPARED = 1.2  # factor of the number of reaches in the present world after which it is compared again with earlier ones
MAX_PAIRS = 2500  # of state and target: 50 MB
REPEATS = 768  # repeated reaches, or pairs beyond MAX_PAIRS, after which they are merged
RASTER = 0.01, 1.25  # m, cell size within which targets are merged first, and its factor for each next attempt
MAX_RASTER = 10.0  # m, at which all targets of a state are merged
JITTER = 1e-9  # of the prior variance, added to the diagonal against rounding errors


class GaussianProcess:
    """Predicts rewards by Gaussian process regression.

    It is exact up to about 2500 pairs of state and target; with more pairs, near targets of a state are merged. Use it for spaces of some
    hundred states: time and memory grow with the square of this number. After many reaches, the first prediction for a target takes up to
    30 ms; a repeated one takes less than a millisecond.

    Args:
        reaches: the reach actions, one for each state, with the marker's position in the state.
        refits: the parameters of the covariance are fitted again when the total number of reaches is one of these numbers.
    """

    def __init__(self, reaches: Reaches, refits: tuple[int, ...] = REFITS) -> None:
        self._reaches, self._refits = reaches, refits
        self._squares = joint_squares(reaches)
        self._covariance = Covariance(self._squares, default_parameters(reaches))
        self._arm, self._reached = LinearArm(reaches), Reached()
        self._factors = ONE_WORLD
        self._here, self._next = 0, 1.0  # reaches in the present world, and their number at the next comparison
        self._rebuild()

    @property
    def settings(self) -> dict[str, Any]:
        """The name of the predictor and its settings, as JSON values."""
        return {"name": "gp", "before": "linear arm", "refits": list(self._refits)}

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn from the reward of a reach that began in `state`, for a target (3,) m, root frame.

        `state`: number of the state. `expected` (the reward that `mean` predicted) is not used.
        """
        world = len(self._factors) - 1
        if self._reached.pair(state, target, world) is not None:
            self._repeats += 1
        self._pending.append((state, target.copy(), reward - self._arm.rewards(np.array([state]), target).item()))
        self._reached.add(state, target, reward, world)
        self._here += 1
        if self._reached.tries in self._refits:
            self._fit()
        elif world and self._here >= self._next:
            self._compare()
        elif self._repeats >= REPEATS or len(self._posterior) + len(self._pending) >= self._size:
            self._rebuild()

    def begin_world(self) -> None:
        """Predict from now on for another world or another robot, in which all later reaches are made.

        Rewards of earlier worlds still influence the predictions: the more they differ from later rewards, the less. The variance of the
        differences is estimated after 1, 2, 3, 4, 5, 6, 8, ... reaches in the present world.
        """
        self._factors = np.append(self._factors, 0.0)
        self._here, self._next = 0, 1.0

    def mean(self, target: Array) -> Array:
        """Return the expected reward of a reach from each of the S states for a target (3,) m, root frame: shape (S,)."""
        return self._prior_mean(target) + self._about(target)[0]

    def deviation(self, target: Array) -> Array:
        """Return the standard deviation of the mean reward of a reach from each of the S states for a target (3,) m, root frame: (S,)."""
        deviation: Array = np.sqrt(np.maximum(self._about(target)[1].diagonal(), 0.0))
        return deviation

    def sample(self, target: Array, rng: np.random.Generator) -> Array:
        """Return a random sample (S,) from the joint posterior of the mean rewards of all S states for a target (3,) m, root frame."""
        mean, covariance = self._about(target)
        jitter = JITTER * self._covariance.prior * np.eye(len(mean))
        drawn: Array = self._prior_mean(target) + mean + np.linalg.cholesky(covariance + jitter) @ rng.standard_normal(len(mean))
        return drawn

    def _about(self, target: Array) -> tuple[Array, Array]:
        """Return the posterior of a target (3,) m, given all reaches, as `Posterior.about` returns it: mean (S,) and covariance (S, S).

        Reaches that were added since the last call are included in the posterior only now, to save computing time.
        """
        for state, place, residual in self._pending:
            self._posterior.append(state, place, residual)
        self._pending.clear()
        return self._posterior.about(target)

    def _prior_mean(self, target: Array) -> Array:
        """Return the prior mean of each state, shape (S,)."""
        return self._arm.rewards(np.arange(len(self._reaches)), target)

    def _fit(self) -> None:
        known = self._reached
        self._arm = self._arm.fitted(known)
        expected = self._arm.rewards(known.state, known.places[known.target])
        logs = fitted_parameters(self._covariance.logs, self._arm, self._squares, known, expected, self._factors)
        self._covariance = Covariance(self._squares, logs)
        self._rebuild()

    def _compare(self) -> None:
        """Estimate how much the mean rewards of earlier worlds differ from those of the present one."""
        self._next = self._here * COMPARED
        known, chosen = self._reached, fitted_pairs(self._reached)
        state, target = known.state[chosen], known.places[known.target[chosen]]
        seen = points(self._arm, state, target)
        residual = known.mean[chosen] - self._arm.rewards(state, target)
        between, noise = self._covariance.between(seen, seen), self._covariance.noise / known.count[chosen]
        self._factors = fitted_factors(between, noise, residual, known.world[chosen], self._factors)
        self._rebuild()

    def _rebuild(self) -> None:
        """Make the posterior again from the averages of all pairs."""
        state, target, mean, count, world = thinned(self._reached, MAX_PAIRS)
        residual = mean - self._arm.rewards(state, target)
        self._posterior = Posterior(self._arm, self._covariance, state, target, residual, count, scales_of(world, self._factors))
        self._pending: list[tuple[int, Array, float]] = []  # reaches that no query has needed yet
        self._repeats, self._size = 0, max(len(state), MAX_PAIRS) + REPEATS


def thinned(known: Reached, most: int) -> tuple[Ints, Array, Array, Array, Ints]:
    """Return the observed pairs of state and target; if there are more than `most`, merge pairs with near targets.

    The results are the state (n,), target (n, 3) m, average reward (n,), number of tries (n,) and world (n,) of each of the n pairs. States
    and worlds are numbers; targets are in the root frame. `known`: the reaches observed so far. Pairs of the same state and world whose
    targets lie in the same cell of a cubic grid are merged into one pair with the average target and reward, weighted by the number of
    tries. The cells grow until at most `most` pairs remain, or the largest cell (10 m) is reached; so at least one pair of each state and
    world remains.
    """
    state, world, raster, step = known.state, known.world, *RASTER
    which = np.arange(len(known))
    while len(state) > most and raster <= MAX_RASTER:
        cell = np.column_stack([known.state, known.world, np.round(known.places[known.target] / raster)])
        _, first, which = np.unique(cell, axis=0, return_index=True, return_inverse=True)
        state, world, raster = known.state[first], known.world[first], raster * step
    if len(state) == len(known):
        return state, known.places[known.target], known.mean, known.count, world
    columns = np.column_stack([known.places[known.target], known.mean, np.ones(len(known))]) * known.count[:, None]
    sums = np.zeros((len(state), columns.shape[1]))
    np.add.at(sums, which, columns)
    averages = sums[:, :-1] / sums[:, -1:]
    return state, averages[:, :3], averages[:, 3], sums[:, -1], world
