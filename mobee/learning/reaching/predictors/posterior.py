"""What is known of the rewards for each target, given all reaches: the exact posterior of the Gaussian process.

A lower triangular factor grows by a row a reach.  For every target asked about, the rows of its states are kept and continued when
it is asked about again, by whole blocks: so what is said depends on the reaches alone, not on what was asked before.
"""

from __future__ import annotations

import numpy as np

from mobee.learning.reaching.predictors.covariance import Covariance, Points, points
from mobee.learning.reaching.predictors.linear_arm import LinearArm
from mobee.learning.reaching.room import forget
from mobee.robot.robot import Array, Ints

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
