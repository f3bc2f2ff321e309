"""The interface of reward predictors, and the prior from the distance between hand and target."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np

from mobee.arrays import Array
from mobee.learning.reaching.predictors.observed import Reached, around
from mobee.learning.reaching.reaches import Reaches


@runtime_checkable
class RewardPredictor(Protocol):
    """Predicts rewards of reaching from each of S states.

    What it predicts follows from its settings and the sequence of `add` alone, so that learned reaches are rebuilt from their
    record; asking changes nothing.  Targets are positions (3,) m, root frame, any number of distinct ones.
    """

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn how a reach from a state went; `expected`: what `mean` said of it just before."""
        ...

    def mean(self, target: Array) -> Array:
        """Expected reward of reaching from each state, shape (S,): for exploitation."""
        ...

    def deviation(self, target: Array) -> Array:
        """Standard deviation of what is not known of the expected rewards, shape (S,); raises InvalidValue if it has none."""
        ...

    def sample(self, target: Array, rng: np.random.Generator) -> Array:
        """One draw of the reward function, shape (S,); raises InvalidValue if there is nothing to draw from."""
        ...

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides what it predicts, as plain JSON values."""
        ...


KNOTS = np.linspace(0.0, 0.6, 13)  # m
BOND = 2.0  # how much a knot holds to its neighbours, in reaches
PULL = 0.1  # and to the average of all rewards


def lengths(reaches: Reaches, target: Array) -> Array:
    """From each state's hand to a target, shape (S,), or to targets (T, 3), shape (S, T), in m."""
    far: Array = np.sqrt(((target - reaches.hands.reshape(-1, *[1] * (target.ndim - 1), 3)) ** 2).sum(axis=-1))
    return far


class DistancePrior:
    """A line through knots, fitted to all reaches seen when it is made; flat beyond the last knot."""

    def __init__(self, reaches: Reaches, known: Reached) -> None:
        self._reaches = reaches
        middle, _ = around(known)
        weights = _shares(np.linalg.norm(known.places[known.target] - reaches.hands[known.state], axis=1))
        step = np.diff(np.eye(len(KNOTS)), axis=0)
        square = (weights.T * known.count) @ weights + BOND * step.T @ step + PULL * np.eye(len(KNOTS))
        self._values = np.linalg.solve(square, (weights.T * known.count) @ known.mean + PULL * middle)

    def mean(self, target: Array) -> Array:
        """Expected rewards, shape (S,), or (S, T) for targets (T, 3)."""
        far = lengths(self._reaches, target)
        expected: Array = np.interp(far, KNOTS, self._values)
        return expected


def _shares(far: Array) -> Array:
    """How much of each knot is in a distance, shape (n, knots)."""
    shares: Array = np.stack([np.interp(far, KNOTS, one) for one in np.eye(len(KNOTS))], axis=-1).reshape(-1, len(KNOTS))
    return shares
