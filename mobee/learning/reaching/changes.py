# SPDX-License-Identifier: Apache-2.0
"""Detects that the world has changed, from how probable the outcomes of transitions and reaches were.

Before a change of the world, a small share of the outcomes contradicts what was learned; after it, a larger share does.  A detector gets,
for each outcome, its probability (density) according to what was learned, and according to no knowledge at all.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.learning.reaching.failures import FailuresSinceChange, by_target
from mobee.learning.reaching.planning import REACH, ReachPlanning
from mobee.learning.reaching.predictors.predictor import RewardPredictor
from mobee.learning.reaching.tries import Step

SHARES = np.array([0.01, 0.03, 0.1, 0.2, 0.4, 0.7, 0.95])  # of outcomes that contradict what was learned, equally likely at first
HAZARDS = np.array([1e-2, 1e-3, 1e-4, 1e-5])  # of a change before an outcome, equally likely at first
MAX_RUNS = 200  # of which the present one may be; the most probable are kept
CERTAIN = 0.95  # probability that the share of a new run differs from that of the run before


class Detector(Protocol):
    """Decides from a sequence of outcomes when the world has changed; its decisions follow from that sequence alone."""

    def add(self, learned: float, unknown: float) -> int | None:
        """Add an outcome; returns the number of outcomes since a change that is detected now, this one included, else None.

        `learned`: probability or density of the outcome by what was learned; `unknown`: without any knowledge.
        """
        ...


DetectorOf = Callable[[], Detector]
"""A class or function that makes the detector of a learner."""


class RunLength:
    """Bayesian online change point detection: a change is detected when it is more probable than none (Adams and MacKay 2007).

    In a run without a change, a constant share of the outcomes has the probability `unknown` and the others have `learned`.  Neither the
    share nor the probability of a change is a setting: they are integrated over `SHARES` and `HAZARDS`.  A change to a smaller share,
    as when the learner learns, begins a new run but is not reported.
    """

    def __init__(self) -> None:
        self._outcomes, self._known = 0, 0  # their number, and that before the run that is certain
        self._start: Ints = np.zeros(1, dtype=np.intp)  # (R,) outcomes before each run
        self._weight: Array = np.full((1, len(HAZARDS)), 1.0 / len(HAZARDS))  # (R, H) joint probability of run and hazard
        self._share: Array = np.full((1, len(SHARES)), 1.0 / len(SHARES))  # (R, shares) probability of each share, given the run
        self._before: Array = self._share[0]  # (shares,) in the run that is certain

    def add(self, learned: float, unknown: float) -> int | None:
        """See Detector."""
        likely = (1.0 - SHARES) * learned + SHARES * unknown
        fresh = np.full((1, len(SHARES)), 1.0 / len(SHARES))
        begun = self._weight.sum(axis=0) * HAZARDS * likely.mean()
        weight = np.vstack([self._weight * (1.0 - HAZARDS) * (self._share @ likely)[:, None], begun])
        share = np.vstack([self._share, fresh]) * likely
        kept = np.sort(np.argsort(-weight.sum(axis=1), kind="stable")[:MAX_RUNS])
        self._start = np.append(self._start, self._outcomes)[kept]
        self._weight, self._share = weight[kept] / weight[kept].sum(), share[kept] / share[kept].sum(axis=1, keepdims=True)
        self._outcomes += 1
        return self._decided()

    def _decided(self) -> int | None:
        """Return the length of the new run, if there is one with a larger share; a new run becomes the one that is certain."""
        probability = self._weight.sum(axis=1)
        later = self._start > self._known
        if probability[later].sum() <= 0.5:
            self._before = probability[~later] @ self._share[~later] / probability[~later].sum()
            return None
        best = int(self._start[later][probability[later].argmax()])
        now = probability[later] @ self._share[later] / probability[later].sum()
        larger, smaller = float(np.tril(np.outer(now, self._before), -1).sum()), float(np.triu(np.outer(now, self._before), 1).sum())
        if max(larger, smaller) < CERTAIN:
            return None
        kept = self._start >= best
        self._known, self._start, self._before = best, self._start[kept], now
        self._weight, self._share = self._weight[kept] / self._weight[kept].sum(), self._share[kept]
        return self._outcomes - best if larger >= CERTAIN else None


NONE = "none"
DETECTORS: dict[str, DetectorOf | None] = {NONE: None, "run_length": RunLength}
"""By name: what makes a detector that has seen nothing; None: changes are ignored."""

NOISE, IMAGINED = 0.05, 4.0  # standard deviation of a reward around its mean before there are repeats; its weight, in repeats


class RewardScale:
    """The scatter of rewards of the same reach, from repeated reaches."""

    def __init__(self) -> None:
        self._square, self._weight = IMAGINED * NOISE**2, IMAGINED
        self._known: dict[tuple[int, bytes], tuple[int, float]] = {}  # number and mean of the rewards, by state and target

    @property
    def variance(self) -> float:
        """Variance of the rewards of one reach around their mean."""
        return self._square / self._weight

    def add(self, state: int, target: Array, reward: float) -> None:
        """Add the reward of a reach from a state for a target (3,) m."""
        key = state, target.tobytes()
        count, mean = self._known.get(key, (0, 0.0))
        if count:
            self._square += (reward - mean) ** 2 * count / (count + 1.0)
            self._weight += 1.0
        self._known[key] = count + 1, mean + (reward - mean) / (count + 1.0)

    def repeated(self, state: int, target: Array) -> bool:
        """Return whether this reach was made before."""
        return (state, target.tobytes()) in self._known


def normal_density(value: float, mean: float, variance: float) -> float:
    """Return the density of a normal distribution."""
    return math.exp(-0.5 * (value - mean) ** 2 / variance) / math.sqrt(2.0 * math.pi * variance)


LEAST = 0.01  # probability of an outcome of a transition that contradicts what was learned
UNKNOWN = 0.5, 1.0  # without knowledge: probability that a transition reaches its goal, and density of a reward in [0, 1]


class WorldChanges:
    """Reports changes of the world to the memory of failures of a learner, as soon as they are detected.

    Args:
        detector: decides when the world has changed.
        planning: knows the outcomes of the transitions.
        predictor: knows the deviations of the rewards.
        failures: gets the number of transitions since a change.
    """

    def __init__(self, detector: Detector, planning: ReachPlanning, predictor: RewardPredictor, failures: FailuresSinceChange) -> None:
        self.detected: list[int] = []
        """The numbers of the steps at which changes were detected."""
        self._detector, self._planning, self._predictor, self._failures = detector, planning, predictor, failures
        self._scale = RewardScale()
        self._is_reach: list[bool] = []  # of all outcomes that the detector got

    def probabilities(self, step: Step, target: Array, goal: int) -> tuple[float, float] | None:
        """Return the probability of a step's outcome before it is learned, and that without knowledge; None if the target caused it.

        `target`: (3,) m.  `goal`: the state that a transition should reach.
        """
        if step.a == REACH:
            variance = self._variance(step.s, target)
            return (UNKNOWN[1], UNKNOWN[1]) if variance is None else (normal_density(step.reward, step.expected, variance), UNKNOWN[1])
        if by_target(step.touched):
            return None
        outcomes, probabilities = self._planning.outcomes[step.s, step.a], self._planning.probabilities[step.s, step.a]
        success = float(probabilities[outcomes == goal].sum()) * (1.0 - self._failures.blocked(step.s, step.a))
        return max(success if step.s_next == goal else 1.0 - success, LEAST), UNKNOWN[0]

    def observe(self, step: Step, target: Array, probabilities: tuple[float, float]) -> bool:
        """Add a step that was learned, with what `probabilities` returned before; returns whether a change was detected."""
        self._is_reach.append(step.a == REACH)
        if step.a == REACH:
            self._scale.add(step.s, target, step.reward)
        since = self._detector.add(*probabilities)
        if since is None:
            return False
        self._failures.change(since - sum(self._is_reach[-since:]))
        self.detected.append(step.n)
        return True

    def _variance(self, state: int, target: Array) -> float | None:
        """Return the variance of the reward to expect; None if it is unknown."""
        try:
            deviation = float(self._predictor.deviation(target)[state])
        except InvalidValue:  # a predictor without deviations: only repeated reaches inform
            if not self._scale.repeated(state, target):
                return None
            deviation = 0.0
        return deviation**2 + self._scale.variance
