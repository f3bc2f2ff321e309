"""What predictors that say a mean and a deviation of each state on its own have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from mobee.learning.reaching.predictors.reached import Reached
from mobee.robot.robot import Array


class Independent(ABC):
    """Mean rewards are normal, each on its own, and follow from the reaches merged in `_reached`."""

    def __init__(self) -> None:
        self._reached = Reached()

    @property
    @abstractmethod
    def settings(self) -> dict[str, Any]:
        """All that decides what it predicts, as plain JSON values."""

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn how a reach went."""
        self._reached.add(state, target, reward)

    def mean(self, target: Array) -> Array:
        """Expected reward of reaching from each state, shape (S,)."""
        return self._posterior(target)[0]

    def deviation(self, target: Array) -> Array:
        """Standard deviation of the mean rewards, shape (S,)."""
        return self._posterior(target)[1]

    def sample(self, target: Array, rng: np.random.Generator) -> Array:
        """One draw of the mean rewards, each on its own, shape (S,)."""
        drawn: Array = rng.normal(*self._posterior(target))
        return drawn

    @abstractmethod
    def _posterior(self, target: Array) -> tuple[Array, Array]:
        """Means and standard deviations of the mean rewards for a target (3,) m, each (S,) and the caller's own."""
