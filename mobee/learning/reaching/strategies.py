# SPDX-License-Identifier: Apache-2.0
"""Strategies for learning to reach: each computes the rewards that reaches have in the learner's plans while it learns (thesis 8.3.2).

A reach is an action that pulls a marker from the pose of a state to a target; it is the last action of a plan. The strategies are: random,
greedy, intrinsic (prediction errors), upper bounds, random samples (Thompson sampling) and learning progress.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np

from mobee.arrays import Array
from mobee.learning.reaching.histories import Histories
from mobee.learning.reaching.predictors.predictor import RewardPredictor
from mobee.learning.reaching.reaches import Reaches

WINDOW = 8  # last reaches of a state, of which the newer half is compared with the older
RANDOM_SHARE = 0.2  # of the problem-tries, which reach from a random state


class Progress:
    """A strategy for learning progress: the planned reward of a reach is how much the observed rewards from its state have changed.

    The planned reward is the reward that the learner's plans use. It is the absolute difference between the mean of the newer half and that
    of the older half of the last eight rewards observed from the state, or 1 with fewer than two observed rewards. In one of five
    problem-tries (attempts to reach one target), the planned reward is 1 for a random state and 0 for all others.
    """

    def __init__(self, reaches: Reaches, predictor: RewardPredictor) -> None:
        self._lately: list[deque[float]] = [deque(maxlen=WINDOW) for _ in range(len(reaches))]
        self._interest: Array = np.ones(len(reaches))

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Record the observed `reward` of a reach that began in `state`. `target` and `expected` are not used."""
        lately = self._lately[state]
        lately.append(reward)
        if len(lately) > 1:
            rewards, half = np.array(lately), len(lately) // 2
            self._interest[state] = abs(rewards[-half:].mean() - rewards[:half].mean())

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """Return for each state the change of its last eight rewards: the absolute difference between the means of their halves, (S,).

        For a state with fewer than two rewards it is 1. But with a probability of 0.2, the method returns 1 for a random state and 0 for
        all others. `target` is not used.
        """
        if rng.random() >= RANDOM_SHARE:
            return self._interest.copy()
        worth = np.zeros(len(self._interest))
        worth[rng.integers(len(worth))] = 1.0
        return worth


OPTIMISM = 2.0  # standard deviations that `ucb` adds to the expected reward


@runtime_checkable
class Strategy(Protocol):
    """The interface of strategies: a strategy computes the rewards that reaches have in a learner's plans while it learns.

    A reach pulls a marker from the pose of a state to a target. The rewards decide what the learner tries; they need not be the rewards
    that it will observe. They must depend only on the reaches that were added and on the random generator; the method `rewards` must change
    nothing.
    """

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn from a reach that began in `state`, for a target (3,) m, root frame.

        `reward`: the observed reward. `expected`: the reward that the predictor expected before the reach.
        """
        ...

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """Return the reward of a reach from each of the S states for a target (3,) m, root frame; shape (S,).

        `rng`: random generator; it gives the same random numbers in each call within one problem-try (attempt to reach one target).
        """
        ...


class Random:
    """A strategy: the planned reward of a reach is 1 from one state, drawn for each problem-try, and 0 from all others (thesis 8.3.2).

    The planned reward is the reward in the learner's plans. A problem-try is one attempt to reach one target.
    """

    def __init__(self, reaches: Reaches, predictor: RewardPredictor) -> None:
        self._states = len(reaches)

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Do nothing: this strategy does not learn."""

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """Return 1 for one random state and 0 for all others, shape (S,). `target` is not used."""
        worth = np.zeros(self._states)
        worth[rng.integers(self._states)] = 1.0
        return worth


class Greedy:
    """A strategy: the planned reward of a reach is the reward that the predictor expects (thesis eq. 8.5).

    The planned reward is the reward in the learner's plans. The expected reward may be too high where little was tried: the predictor
    `Weighted` expects 1 for a state that was never tried.
    """

    def __init__(self, reaches: Reaches, predictor: RewardPredictor) -> None:
        self._predictor = predictor

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Do nothing: only the predictor learns from the reach."""

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """Return the reward that the predictor expects of a reach from each state for a target (3,) m, shape (S,)."""
        return self._predictor.mean(target)


class Intrinsic:
    """A strategy: the planned reward of a reach is the prediction error to expect (thesis eqs. 8.6 and 8.7).

    The planned reward is the reward in the learner's plans. An error is the expected minus the observed reward. The error to expect is a
    weighted average over earlier reaches from the same state; errors with nearer targets have larger weights. One imagined error of 1 is
    included in the average, with the weight of distance 0.
    """

    def __init__(self, reaches: Reaches, predictor: RewardPredictor) -> None:
        self._errors = Histories(len(reaches), reaches.scale)

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Record the predictor's error, `expected` minus `reward`, in a reach that began in `state`, for a target (3,) m."""
        self._errors.add(state, target, expected - reward)

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """Return the expected error (predicted minus observed reward) of a reach from each state for a target (3,) m, shape (S,).

        It is 1 for a state that was never tried.
        """
        return self._errors.average(target, 1.0)


class UpperBound(Greedy):
    """A strategy: the planned reward of a reach is the predictor's expected reward plus two of its standard deviations.

    The planned reward is the reward in the learner's plans. The strategy needs a predictor that has deviations.
    """

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """Return for a reach from each state the expected reward plus two times its standard deviation, shape (S,); `target`: (3,) m."""
        return self._predictor.mean(target) + OPTIMISM * self._predictor.deviation(target)


class Thompson(Greedy):
    """A strategy (Thompson sampling): the planned rewards of all reaches are one random sample from the predictor for each problem-try.

    A planned reward is a reward in the learner's plans. The strategy needs a predictor that can be sampled. A problem-try is one attempt to
    reach one target.
    """

    def rewards(self, target: Array, rng: np.random.Generator) -> Array:
        """Return a random sample of the rewards of a reach from each state for a target (3,) m, shape (S,)."""
        return self._predictor.sample(target, rng)


StrategyOf = Callable[[Reaches, RewardPredictor], Strategy]
"""A class or function that makes the strategy of a learner from its `Reaches` and its `RewardPredictor`."""

STRATEGIES: dict[str, StrategyOf] = {
    "random": Random,
    "greedy": Greedy,
    "intrinsic": Intrinsic,
    "ucb": UpperBound,
    "thompson": Thompson,
    "progress": Progress,
}
