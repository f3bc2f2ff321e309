"""Gaussian process regression of the rewards over poses, targets and the ways between: the best predictor here."""

from __future__ import annotations

from typing import Any

import numpy as np

from mobee.learning.reaching.predictors.covariance import Covariance, joint_squares, usual
from mobee.learning.reaching.predictors.evidence import most_likely
from mobee.learning.reaching.predictors.linear_arm import LinearArm
from mobee.learning.reaching.predictors.posterior import Posterior
from mobee.learning.reaching.predictors.predictor import Reaches
from mobee.learning.reaching.predictors.reached import Reached
from mobee.robot.robot import Array, Ints

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
