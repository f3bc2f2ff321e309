# SPDX-License-Identifier: Apache-2.0
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

    Predictions must follow from its settings and the sequence of `add` alone, so that they can be rebuilt from a record; the other
    methods change nothing.  Targets are positions (3,) m, root frame, any number of distinct ones.
    """

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn from a reach from a state; `expected`: the value of `mean` just before."""
        ...

    def mean(self, target: Array) -> Array:
        """Return the expected reward of reaching from each state, shape (S,)."""
        ...

    def deviation(self, target: Array) -> Array:
        """Return the standard deviation of the expected rewards, shape (S,); raises InvalidValue if it has none."""
        ...

    def sample(self, target: Array, rng: np.random.Generator) -> Array:
        """Return one draw of the reward function, shape (S,); raises InvalidValue if it has no distribution."""
        ...

    @property
    def settings(self) -> dict[str, Any]:
        """Settings that determine its predictions, as plain JSON values."""
        ...


KNOTS = np.linspace(0.0, 0.6, 13)  # m, distances between hand and target
SMOOTHNESS = 2.0  # weight of equal values at neighbouring knots, in reaches
SHRINKAGE = 0.1  # weight of the average of all rewards at each knot, in reaches


def lengths(reaches: Reaches, target: Array) -> Array:
    """Return the distance from each state's hand to a target, shape (S,), or to targets (T, 3), shape (S, T), in m."""
    far: Array = np.sqrt(((target - reaches.hands.reshape(-1, *[1] * (target.ndim - 1), 3)) ** 2).sum(axis=-1))
    return far


class DistancePrior:
    """Expected reward by distance: linear between knots, fitted to all reaches so far, constant beyond the last knot."""

    def __init__(self, reaches: Reaches, known: Reached) -> None:
        self._reaches = reaches
        middle, _ = around(known)
        weights = _shares(np.linalg.norm(known.places[known.target] - reaches.hands[known.state], axis=1))
        step = np.diff(np.eye(len(KNOTS)), axis=0)
        square = (weights.T * known.count) @ weights + SMOOTHNESS * step.T @ step + SHRINKAGE * np.eye(len(KNOTS))
        self._values = np.linalg.solve(square, (weights.T * known.count) @ known.mean + SHRINKAGE * middle)

    def mean(self, target: Array) -> Array:
        """Return expected rewards, shape (S,), or (S, T) for targets (T, 3)."""
        far = lengths(self._reaches, target)
        expected: Array = np.interp(far, KNOTS, self._values)
        return expected


def _shares(far: Array) -> Array:
    """Return the interpolation weights of the knots at each distance, shape (n, knots)."""
    shares: Array = np.stack([np.interp(far, KNOTS, one) for one in np.eye(len(KNOTS))], axis=-1).reshape(-1, len(KNOTS))
    return shares
