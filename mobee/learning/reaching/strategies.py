# SPDX-License-Identifier: Apache-2.0
"""Strategies compute the reward of a reach from each state: random, greedy, intrinsic, bounds, samples, progress (thesis 8.3.2)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Protocol

import numpy as np

from mobee.arrays import Array
from mobee.learning.reaching.histories import Histories
from mobee.learning.reaching.predictors.predictor import RewardPredictor
from mobee.learning.reaching.reaches import Reaches

WINDOW = 8  # last reaches of a state, of which the newer half is compared with the older
RANDOM_SHARE = 0.2  # of the problem-tries, which reach from a random state


class Progress:
    """The reward of a reach is the change of its state's rewards over the last eight reaches; 1 where there are fewer than two."""

    def __init__(self, reaches: Reaches, predictor: RewardPredictor) -> None:
        self._lately: list[deque[float]] = [deque(maxlen=WINDOW) for _ in range(len(reaches))]
        self._interest: Array = np.ones(len(reaches))

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Add a reward to the state's recent rewards and update the state's interest: how much these rewards have changed."""
        lately = self._lately[state]
        lately.append(reward)
        if len(lately) > 1:
            rewards, half = np.array(lately), len(lately) // 2
            self._interest[state] = abs(rewards[-half:].mean() - rewards[:half].mean())

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """Return the change of the rewards of each state, (S,); in one of five problem-tries, 1 for a random state and 0 for all others."""
        if rng.random() >= RANDOM_SHARE:
            return self._interest.copy()
        worth = np.zeros(len(self._interest))
        worth[rng.integers(len(worth))] = 1.0
        return worth


OPTIMISM = 2.0  # standard deviations that `ucb` adds to the expected reward


class Strategy(Protocol):
    """Computes the rewards of the reach actions that a learner plans with.

    They must follow from the reaches added and the generator alone; `rewards` changes nothing.
    """

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn from a reach; the arguments are those of `RewardPredictor.add`."""
        ...

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """Return the reward of reaching from each state, shape (S,); the generator is the same throughout a problem-try."""
        ...


class Random:
    """The reward of a reach is 1 from one state, drawn for each problem-try, and 0 from all others (thesis 8.3.2)."""

    def __init__(self, reaches: Reaches, predictor: RewardPredictor) -> None:
        self._states = len(reaches)

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn nothing."""

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """Return 1 for one state and 0 for the others, shape (S,)."""
        worth = np.zeros(self._states)
        worth[rng.integers(self._states)] = 1.0
        return worth


class Greedy:
    """The reward of a reach is the predictor's expected reward, which may be optimistic (thesis eq. 8.5)."""

    def __init__(self, reaches: Reaches, predictor: RewardPredictor) -> None:
        self._predictor = predictor

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn nothing; the predictor learns from the reach."""

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """Return the expected rewards, shape (S,)."""
        return self._predictor.mean(target)


class Intrinsic:
    """The reward of a reach is the prediction error to expect from the predictor's past errors (thesis eqs. 8.6 and 8.7)."""

    def __init__(self, reaches: Reaches, predictor: RewardPredictor) -> None:
        self._errors = Histories(len(reaches), reaches.scale)

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Append the error, expected minus actual reward, to the history of the state."""
        self._errors.add(state, target, expected - reward)

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """Return the expected errors, shape (S,): 1 for a state that was never tried."""
        return self._errors.average(target, 1.0)


class UpperBound(Greedy):
    """The reward of a reach is the expected reward plus two standard deviations; needs a predictor that has a deviation."""

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """Return the upper confidence bounds, shape (S,)."""
        return self._predictor.mean(target) + OPTIMISM * self._predictor.deviation(target)


class Thompson(Greedy):
    """The reward of a reach is that of one sample of the reward function for each problem-try; needs a predictor with samples."""

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """Return the drawn rewards, shape (S,)."""
        return self._predictor.sample(target, rng)


StrategyOf = Callable[[Reaches, RewardPredictor], Strategy]
"""A class or function that makes the strategy of a learner from its reaches and its predictor."""

STRATEGIES: dict[str, StrategyOf] = {
    "random": Random,
    "greedy": Greedy,
    "intrinsic": Intrinsic,
    "ucb": UpperBound,
    "thompson": Thompson,
    "progress": Progress,
}
