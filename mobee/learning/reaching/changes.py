# SPDX-License-Identifier: Apache-2.0
"""Detects that the world has changed, from the probabilities of the outcomes of transitions and reaches.

Before a change of the world, a small share of the outcomes contradicts what was learned; after the change, a larger share does. For each
outcome a detector gets two probabilities (densities for rewards): according to what was learned, and without any knowledge.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.learning.reaching.failures import FailuresSinceChange, by_target
from mobee.learning.reaching.predictors.predictor import RewardPredictor, begin_world
from mobee.learning.reaching.reaches import REACH, ReachPlanning
from mobee.learning.reaching.store import Step

SHARES = np.array([0.01, 0.03, 0.1, 0.2, 0.4, 0.7, 0.95])  # of outcomes that contradict what was learned, equally likely at first
HAZARDS = np.array([1e-2, 1e-3, 1e-4, 1e-5])  # of a change before an outcome, equally likely at first
MAX_RUNS = 200  # of which the present one may be; the most probable are kept
CERTAIN = 0.95  # probability that the share of a new run differs from that of the run before


class Detector(Protocol):
    """Decides from a sequence of outcomes when the world has changed. Its decisions must depend only on this sequence."""

    def add(self, learned: float, unknown: float) -> int | None:
        """Process one outcome; if it reveals a change, return the number of outcomes since the change, this one included; otherwise None.

        `learned`: probability, or density, of the outcome according to what was learned. `unknown`: its probability, or density, if nothing
        was learned.
        """
        ...


DetectorOf = Callable[[], Detector]
"""A class or function without arguments that makes the detector of a learner."""


class RunLength:
    """Bayesian online change point detection (Adams and MacKay 2007) for the share of outcomes that contradict what was learned.

    A change is reported when it is more probable than no change, and when the share has increased with a probability of at least 0.95
    (CERTAIN). Between two changes, a constant share of the outcomes contradicts what was learned and has the probability `unknown`; the
    others have the probability `learned` (the two arguments of `add`). The share and the probability of a change are unknown, not settings:
    the detector weighs all values in `SHARES` (0.01 to 0.95) and `HAZARDS` (0.01 to 0.00001) by their probability. A decrease of the share
    is not reported, because it occurs without a change of the world: the predictions of the learner become better.
    """

    def __init__(self) -> None:
        self._outcomes, self._known = 0, 0  # their number, and that before the run that is certain
        self._start: Ints = np.zeros(1, dtype=np.intp)  # (R,) outcomes before each run
        self._weight: Array = np.full((1, len(HAZARDS)), 1.0 / len(HAZARDS))  # (R, H) joint probability of run and hazard
        self._share: Array = np.full((1, len(SHARES)), 1.0 / len(SHARES))  # (R, shares) probability of each share, given the run
        self._before: Array = self._share[0]  # (shares,) in the run that is certain

    def add(self, learned: float, unknown: float) -> int | None:
        """Process one outcome; if it reveals a change, return the number of outcomes since the change, this one included; otherwise None.

        `learned` and `unknown`: probability or density of the outcome, as in `Detector.add`.
        """
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
        """Return the number of outcomes since a change that is now certain, if the world contradicts more of them than before; else None.

        A run is the time between two changes; its share is the part of its outcomes that contradicts what was learned. A change is certain
        if a run began after the last certain change with a probability above 0.5, and its share differs from that before with a
        probability of at least CERTAIN (0.95). A certain change to a smaller share is recorded too, but returns None.
        """
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
"""By name, what makes the detector of a learner; None: changes are not detected."""

NOISE, IMAGINED = 0.05, 4.0  # standard deviation of a reward around its mean before there are repeats; its weight, in repeats


class RewardScale:
    """Estimates how much the rewards of the same reach (from one state, for one target) scatter, from reaches that were repeated."""

    def __init__(self) -> None:
        self._square, self._weight = IMAGINED * NOISE**2, IMAGINED
        self._known: dict[tuple[int, bytes], tuple[int, float]] = {}  # number and mean of the rewards, by state and target

    @property
    def variance(self) -> float:
        """The variance of the rewards of one reach (one state and target) around their mean; 0.05^2 until a reach has been repeated."""
        return self._square / self._weight

    def add(self, state: int, target: Array, reward: float) -> None:
        """Record the reward of a reach from a state for a target at (3,) m, root frame."""
        key = state, target.tobytes()
        count, mean = self._known.get(key, (0, 0.0))
        if count:
            self._square += (reward - mean) ** 2 * count / (count + 1.0)
            self._weight += 1.0
        self._known[key] = count + 1, mean + (reward - mean) / (count + 1.0)

    def repeated(self, state: int, target: Array) -> bool:
        """Return whether a reach from this state for this target, (3,) m, was recorded before."""
        return (state, target.tobytes()) in self._known


def normal_density(value: float, mean: float, variance: float) -> float:
    """Return the density of the normal distribution with this mean and variance at `value`."""
    return math.exp(-0.5 * (value - mean) ** 2 / variance) / math.sqrt(2.0 * math.pi * variance)


LEAST = 0.01  # probability of an outcome of a transition that contradicts what was learned
UNKNOWN = 0.5, 1.0  # without knowledge: probability that a transition reaches its goal, and density of a reward in [0, 1]


class WorldChanges:
    """Detects changes of the world from a learner's steps, and reports them to the learner's memory of failed transitions.

    Args:
        make_detector: makes the detector, which decides when the world has changed.
        planning: gives the probabilities of the outcomes of transitions.
        predictor: gives the standard deviations of rewards. If it gives none, a reach is evidence for or against a change only if an
            earlier reach had the same state and target.
        failures: the memory of failed transitions; its method `change` is called with the number of transitions since the change.
    """

    def __init__(
        self, make_detector: DetectorOf, planning: ReachPlanning, predictor: RewardPredictor, failures: FailuresSinceChange
    ) -> None:
        self.detected: list[int] = []
        """The numbers of the steps at which changes were detected."""
        self._make_detector, self._detector = make_detector, make_detector()
        self._planning, self._predictor, self._failures = planning, predictor, failures
        self._scale = RewardScale()
        self._is_reach: list[bool] = []  # of all outcomes that the detector got

    def probabilities(self, step: Step, target: Array, goal: int) -> tuple[float, float] | None:
        """Return how probable the result of a step (a transition or a reach) was: by what was learned, and without any knowledge.

        These are the arguments `learned` and `unknown` of `Detector.add`. For a transition they are the probabilities of what happened:
        that it ended in its goal, or that it did not. For a reach they are densities of its reward. Call this before the learner learns
        from the step. None if a transition ended in contact with the target, because the target may then have caused its outcome.
        `target`: (3,) m, root frame, position of the target. `goal`: the goal state of a transition.
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
        """Process a step after the learner has learned from it; return whether a change of the world was detected.

        `target`: (3,) m, root frame, position of the target. `probabilities`: the result of `WorldChanges.probabilities` for this step,
        before the learner learned from it.
        """
        self._is_reach.append(step.a == REACH)
        if step.a == REACH:
            self._scale.add(step.s, target, step.reward)
        since = self._detector.add(*probabilities)
        if since is None:
            return False
        self._failures.change(since - sum(self._is_reach[-since:]))
        self.detected.append(step.n)
        return True

    def report(self) -> None:
        """Record that the world changes now; for a change that is known without the detector.

        The memory of failed transitions estimates which transitions the world blocks for all targets; from now on, it uses only later
        transitions for this estimate. A predictor that can compare worlds (`WorldComparer`) treats later rewards as those of another world.
        A new detector is made, because the outcomes before this change are no evidence about later changes.
        """
        self._failures.change(0)
        begin_world(self._predictor)
        self.restart()

    def restart(self) -> None:
        """Replace the detector by a new one that has processed no outcome. The memory of failed transitions does not change."""
        self._detector = self._make_detector()

    def _variance(self, state: int, target: Array) -> float | None:
        """Return the variance of the reward of a reach from a state for a target (3,) m, around its expected reward.

        It is None if the predictor has no deviations and no reach from this state for this target was recorded.
        """
        try:
            deviation = float(self._predictor.deviation(target)[state])
        except InvalidValue:  # a predictor without deviations: only repeated reaches inform
            if not self._scale.repeated(state, target):
                return None
            deviation = 0.0
        return deviation**2 + self._scale.variance
