"""Competence progress: reach from where reaching has lately become better, or worse (Baranes and Oudeyer 2013; goal babbling)."""

from __future__ import annotations

from collections import deque

import numpy as np

from mobee.learning.reaching.predictors.predictor import Reaches, RewardPredictor
from mobee.robot.robot import Array

WINDOW = 8  # reaches of a state that are compared, the newer half with the older
AT_RANDOM = 0.2  # share of problem-tries that reach from a random state


class Progress:
    """The change of a state's rewards over its last eight reaches; 1 where there are fewer than two."""

    def __init__(self, reaches: Reaches, predictor: RewardPredictor) -> None:
        self._lately: list[deque[float]] = [deque(maxlen=WINDOW) for _ in range(len(reaches))]
        self._interest: Array = np.ones(len(reaches))

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Append a reward to the state's last ones."""
        lately = self._lately[state]
        lately.append(reward)
        if len(lately) > 1:
            rewards, half = np.array(lately), len(lately) // 2
            self._interest[state] = abs(rewards[-half:].mean() - rewards[:half].mean())

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """The changes, shape (S,); in one problem-try of five 1 for one state and 0 for all others."""
        if rng.random() >= AT_RANDOM:
            return self._interest.copy()
        worth = np.zeros(len(self._interest))
        worth[rng.integers(len(worth))] = 1.0
        return worth
