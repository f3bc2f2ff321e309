"""Gaussian process regression of the rewards over poses and targets: the best predictor here.

A lower triangular factor grows by a row a reach.  For every target asked about, the rows of its states are kept and continued when
it is asked about again, by whole blocks: so what is said depends on the reaches alone, not on what was asked before.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.reaching.histories import forget
from mobee.learning.reaching.predictors.covariance import Covariance, Points, joint_squares, most_likely, points, usual
from mobee.learning.reaching.predictors.linear_arm import LinearArm
from mobee.learning.reaching.predictors.observed import Reached
from mobee.learning.reaching.reaches import Reaches

BLOCK = 32  # rows
KEPT = 300e6  # bytes of rows and covariances of targets in memory, but those of one at least: of 256 states 31 targets, at the fullest


class Asked:
    """What is known of a target asked about: rows (n, S), of which the first `done` will not change, and their sums."""

    def __init__(self, at: Points, prior: Array, rows: int) -> None:
        self.at, self.done, self.upto = at, 0, 0
        self.rows = np.empty((rows, len(prior)))
        self.sure: tuple[Array, Array] = np.zeros(len(prior)), prior  # of the done rows: mean and covariance
        self.mean, self.covariance = self.sure


class Posterior:
    """Mean and covariance of the rewards from all states, a target.

    Args:
        arm: whose reaches they are.
        covariance: of their mean rewards.
        state: (n,) of the reaches to begin with, for `target` (n, 3) m.
        residual: (n,) rewards less the prior mean, or averages of `count` (n,) rewards.
    """

    def __init__(self, arm: LinearArm, covariance: Covariance, state: Ints, target: Array, residual: Array, count: Array) -> None:
        from scipy.linalg import cholesky, solve_triangular

        self._arm, self._covariance, self._solve = arm, covariance, solve_triangular
        self._all = np.arange(len(arm.reaches))
        self._used = len(state)
        room = -(-self._used // BLOCK) * BLOCK + 8 * BLOCK
        self._state, self._target = np.zeros(room, dtype=np.intp), np.zeros((room, 3))
        self._factor, self._score = np.zeros((room, room)), np.zeros(room)
        self._asked: dict[bytes, Asked] = {}
        if self._used:
            self._state[: self._used], self._target[: self._used] = state, target
            seen = points(arm, state, target)
            matrix = covariance.between(seen, seen) + np.diag(covariance.noise / count)
            factor = cholesky(matrix, lower=True, overwrite_a=True, check_finite=False)
            self._factor[: self._used, : self._used] = factor
            self._score[: self._used] = self._solve(factor, residual, lower=True, check_finite=False)

    def __len__(self) -> int:
        return self._used

    def about(self, target: Array) -> tuple[Array, Array]:
        """Mean (S,) without the prior mean, and covariance (S, S), of the mean rewards for a target (3,) m."""
        known = self._brought_up(target)
        return known.mean, known.covariance

    def append(self, state: int, target: Array, residual: float) -> None:
        """Take one more reach."""
        known = self._brought_up(target)
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
    def _most(self) -> int:
        """Targets that there is memory for: each with its rows, and its covariance twice."""
        states = len(self._all)
        return max(1, int(KEPT // (8 * states * (len(self._score) + 2 * states))))

    def _brought_up(self, target: Array) -> Asked:
        """The rows of a target, to the last."""
        key = target.tobytes()
        known = self._asked.pop(key, None)
        if known is None:
            at = points(self._arm, self._all, target)
            known = Asked(at, self._covariance.between(at, at), len(self._score))
        forget(self._asked, self._most)
        self._asked[key] = known
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

    def _continued(self, known: Asked, first: int, end: int) -> tuple[Array, Array]:
        """Rows first to end of a target; returns mean and covariance with them."""
        new = slice(first, end)
        seen = points(self._arm, self._state[new], self._target[new])
        rows = self._covariance.between(seen, known.at)
        rows -= self._factor[new, :first] @ known.rows[:first]
        rows = self._solve(self._factor[new, new], rows, lower=True, overwrite_b=True, check_finite=False)
        known.rows[new] = rows
        mean, covariance = known.sure
        return mean + rows.T @ self._score[new], covariance - rows.T @ rows

    def _grow(self) -> None:
        room = len(self._score) * 3 // 2 // BLOCK * BLOCK
        self._state, self._score = np.resize(self._state, room), np.resize(self._score, room)
        self._target = np.resize(self._target, (room, 3))
        factor = np.zeros((room, room))
        factor[: self._used, : self._used] = self._factor
        self._factor = factor


REFITS = (30, 60, 120, 250, 500, 1000)  # reaches after which the parameters of the covariance are fitted anew
MOST = 2500  # pairs of state and target: 50 MB
REPEATS = 768  # reaches that repeat others, or pairs beyond the most, after which they are merged
RASTER = 0.01, 1.25  # m: how near targets are merged first, and how much farther each next time
COARSEST = 10.0  # m: then all targets of a state are one
JITTER = 1e-9  # of the variance: what rounding may cost


class GaussianProcess:
    """Exact up to 2500 pairs of a state and a target, or a little more; then targets of a state that are near each other are merged.

    For spaces of some hundred states: time and memory grow with their square.

    A target asked about again costs well under a millisecond; a new one up to 30, the more reaches there were.

    Args:
        reaches: the reach actions.
        refits: after how many reaches the parameters are fitted to the evidence.
    """

    def __init__(self, reaches: Reaches, refits: tuple[int, ...] = REFITS) -> None:
        self._reaches, self._refits = reaches, refits
        self._squares = joint_squares(reaches)
        self._covariance = Covariance(self._squares, usual(reaches))
        self._arm, self._reached = LinearArm(reaches), Reached()
        self._repeats = 0
        self._rebuild()

    @property
    def settings(self) -> dict[str, Any]:
        """Its name and settings, as plain JSON values."""
        return {"name": "gp", "before": "linear arm", "refits": list(self._refits)}

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn how a reach went."""
        if self._reached.pair(state, target) is not None:
            self._repeats += 1
        self._waiting.append((state, target.copy(), reward - self._arm.rewards(np.array([state]), target).item()))
        self._reached.add(state, target, reward)
        if self._reached.tries in self._refits:
            self._fit()
        elif self._repeats >= REPEATS or len(self._posterior) + len(self._waiting) >= self._room:
            self._rebuild()

    def mean(self, target: Array) -> Array:
        """Expected reward of reaching from each state, shape (S,)."""
        return self._before(target) + self._about(target)[0]

    def deviation(self, target: Array) -> Array:
        """Standard deviation of the mean rewards, shape (S,)."""
        deviation: Array = np.sqrt(np.maximum(self._about(target)[1].diagonal(), 0.0))
        return deviation

    def sample(self, target: Array, rng: np.random.Generator) -> Array:
        """One draw of the mean rewards of all states together, shape (S,)."""
        mean, covariance = self._about(target)
        spare = JITTER * self._covariance.prior * np.eye(len(mean))
        drawn: Array = self._before(target) + mean + np.linalg.cholesky(covariance + spare) @ rng.standard_normal(len(mean))
        return drawn

    def _about(self, target: Array) -> tuple[Array, Array]:
        """The posterior of a target, given all reaches: those that wait are taken in now, as few of a long record ever need to be."""
        for state, place, residual in self._waiting:
            self._posterior.append(state, place, residual)
        self._waiting.clear()
        return self._posterior.about(target)

    def _before(self, target: Array) -> Array:
        """What is expected of each state before anything was seen, shape (S,)."""
        return self._arm.rewards(np.arange(len(self._reaches)), target)

    def _fit(self) -> None:
        known = self._reached
        self._arm = self._arm.fitted(known)
        expected = self._arm.rewards(known.state, known.places[known.target])
        self._covariance = Covariance(self._squares, most_likely(self._covariance.logs, self._arm, self._squares, known, expected))
        self._rebuild()

    def _rebuild(self) -> None:
        """Begin again from the averages of all pairs."""
        state, target, mean, count = thinned(self._reached, MOST)
        residual = mean - self._arm.rewards(state, target)
        self._posterior = Posterior(self._arm, self._covariance, state, target, residual, count)
        self._waiting: list[tuple[int, Array, float]] = []  # reaches since then that nobody has asked after yet
        self._repeats, self._room = 0, max(len(state), MOST) + REPEATS


def thinned(known: Reached, most: int) -> tuple[Ints, Array, Array, Array]:
    """State, target (n, 3), average reward and number of tries of pairs; those near each other are one where there are too many.

    There is at least one for each state that was reached from.
    """
    state, raster, step = known.state, *RASTER
    which = np.arange(len(known))
    while len(state) > most and raster <= COARSEST:
        cell = np.column_stack([known.state, np.round(known.places[known.target] / raster)])
        _, first, which = np.unique(cell, axis=0, return_index=True, return_inverse=True)
        state, raster = known.state[first], raster * step
    if len(state) == len(known):
        return state, known.places[known.target], known.mean, known.count
    columns = np.column_stack([known.places[known.target], known.mean, np.ones(len(known))]) * known.count[:, None]
    sums = np.zeros((len(state), columns.shape[1]))
    np.add.at(sums, which, columns)
    averages = sums[:, :-1] / sums[:, -1:]
    return state, averages[:, :3], averages[:, 3], sums[:, -1]
