"""A table of every state and target: what reaching brought just there, and nothing learned for anywhere else."""

from __future__ import annotations

from typing import Any

import numpy as np

from mobee.learning.reaching.predictors.predictor import Reaches
from mobee.learning.reaching.predictors.reached import IMAGINED, Reached, around
from mobee.robot.robot import Array

NOISE = 0.05  # standard deviation of a reward around its mean, before repeats tell


class Table:
    """Averages, drawn to the average of all rewards where there are few.

    Mean rewards are taken as normal around the average of all, with their spread, and rewards as normal around them.

    Args:
        reaches: the reach actions.
    """

    def __init__(self, reaches: Reaches) -> None:
        self._states = len(reaches)
        self._reached = Reached()

    @property
    def settings(self) -> dict[str, Any]:
        """Its name, as plain JSON values."""
        return {"name": "table"}

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
        mean, deviation = self._posterior(target)
        drawn: Array = rng.normal(mean, deviation)
        return drawn

    def _posterior(self, target: Array) -> tuple[Array, Array]:
        known = self._reached
        middle, spread = around(known)
        noise = (known.scatter + IMAGINED * NOISE**2) / (known.tries - len(known) + IMAGINED)
        count, mean = np.zeros(self._states), np.full(self._states, middle)
        place = known.find(target)
        if place is not None:
            here = known.target == place
            count[known.state[here]], mean[known.state[here]] = known.count[here], known.mean[here]
        precision = 1.0 / spread + count / noise
        return (middle / spread + count * mean / noise) / precision, np.sqrt(1.0 / precision)
