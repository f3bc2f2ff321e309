# SPDX-License-Identifier: Apache-2.0
"""Failed transitions as negative rewards: for all targets, nearby ones, or similar transitions (thesis 8.1)."""

from __future__ import annotations

from functools import cache
from types import ModuleType
from typing import Literal

import numpy as np

from mobee.arrays import Array
from mobee.errors import UnknownName
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.reaching.histories import Histories, forget
from mobee.learning.reaching.reaches import Reaches
from mobee.learning.space import Space

LENGTH_SCALE = 0.08  # m, of vectors from hand to target
JOINT_SCALE = 0.4  # of the joints, in units of the spread of a joint's samples
PRIOR_WEIGHT = 0.5  # of the overall failure rate, in transitions
MAX_COST = 0.4  # reward lost by a transition that is certain to fail by its similar ones
MAX_CACHED = 256  # targets whose sums are in memory


class AlikeFailures:
    """Rewards of transitions from failures on the same target, and from failures of similar transitions on other targets.

    A transition that was tried on this target has the average of its rewards and one reward of 0.  Any other has a negative reward if
    similar transitions failed more often than transitions do on average, at least -`MAX_COST`: enough to plan around it at small cost,
    not enough to exclude a state that was never tried.

    Args:
        space: states and transitions.
        reaches: the marker's position in each state.
    """

    def __init__(self, space: Space, reaches: Reaches) -> None:
        self._shape = space.goals.shape
        goals = np.where(space.goals == NO_ACTION, np.arange(len(space))[:, None], space.goals)
        scaled = reaches.samples / np.maximum(np.ptp(reaches.samples, axis=0), 1e-9) / JOINT_SCALE
        hands, joints = ((one[:, None] + one[goals]) / 2.0 for one in (reaches.hands / LENGTH_SCALE, scaled))
        middles = np.concatenate([-hands, joints], axis=2)
        self._middles: Array = np.ascontiguousarray(
            middles.reshape(goals.size, middles.shape[2])
        )  # midpoints of the transitions, relative to the hand
        self._events = np.empty((64, self._middles.shape[1] + 1))  # midpoint with the vector from hand to target, and whether it failed
        self._used, self._failed = 0, 0
        self._own: dict[bytes, dict[int, tuple[float, int]]] = {}  # by target and transition: sum and number of rewards
        self._sums: dict[bytes, tuple[int, Array]] = {}  # by target: events in them, failures and weights (2, S A)

    def add(self, state: int, action: int, target: Array, reward: float) -> None:
        """Record the reward of a transition made while a target (3,) m was presented."""
        transition, tried = state * self._shape[1] + action, self._own.setdefault(target.tobytes(), {})
        total, count = tried.get(transition, (0.0, 0))
        tried[transition] = total + reward, count + 1
        if self._used == len(self._events):
            self._events = np.concatenate([self._events, np.empty_like(self._events)])
        event = self._events[self._used]
        event[:-1], event[-1] = self._middles[transition], reward < 0.0
        event[:3] += target / LENGTH_SCALE
        self._used += 1
        self._failed += reward < 0.0

    def rewards(self, target: Array) -> Array:
        """Return the expected reward of each transition, shape (S, A), at most 0."""
        usual = self._failed / (self._used + 1.0)
        failed, weight = self._alike(target)
        more = (failed + PRIOR_WEIGHT * usual) / (weight + PRIOR_WEIGHT) - usual
        worth: Array = np.maximum(more, 0.0) * (-MAX_COST / (1.0 - usual))
        tried = self._own.get(target.tobytes())
        if tried:
            sums = np.array(list(tried.values()))
            worth[list(tried)] = sums[:, 0] / (1.0 + sums[:, 1])
        return worth.reshape(self._shape)

    def copy(self) -> AlikeFailures:
        """Return an independent copy."""
        other = object.__new__(AlikeFailures)
        other.__dict__.update(self.__dict__)
        other._events, other._sums = self._events.copy(), self._sums.copy()
        other._own = {target: tried.copy() for target, tried in self._own.items()}
        return other

    def _alike(self, target: Array) -> Array:
        """Sum the weights of similar transitions that failed, and of all similar transitions, shape (2, S A)."""
        key = target.tobytes()
        seen, sums = self._sums.pop(key, (0, np.zeros((2, len(self._middles)))))
        if seen < self._used:
            sums, queries = sums.copy(), self._middles.copy()
            queries[:, :3] += target / LENGTH_SCALE
            _core().gaussian_sums(queries, self._events[seen : self._used], sums)
        forget(self._sums, MAX_CACHED)
        self._sums[key] = self._used, sums
        return sums


@cache
def _core() -> ModuleType:
    """Import the native functions when they are first needed."""
    from mobee._core import learning

    return learning


FAILURES = ("spread", "local", "alike")
NEAR_DISTANCE = 0.025  # m, between targets of the published size that block nearly the same transitions


class Failures:
    """Histories of all transitions: 0 for each success and a penalty for each failure, by target.

    Args:
        states, actions: of the space.
        scale: m, the unit of distances.
        kind: "spread": every failure counts for all targets, less for distant ones (thesis eq. 8.1, with 1 added to its denominator,
            since otherwise one failure would exclude a transition for all targets); "local": it counts for targets within 25 mm only.
    """

    def __init__(self, states: int, actions: int, scale: float, kind: Literal["spread", "local"] = "spread") -> None:
        self._shape = states, actions
        self._histories = Histories(states * actions, scale, NEAR_DISTANCE if kind == "local" else np.inf)

    def add(self, state: int, action: int, target: Array, reward: float) -> None:
        """Append the reward of a transition made while a target (3,) m was presented."""
        self._histories.add(state * self._shape[1] + action, target, reward)

    def rewards(self, target: Array) -> Array:
        """Return the expected reward of each transition, shape (S, A), at most 0."""
        return self._histories.average(target, 0.0).reshape(self._shape)

    def copy(self) -> Failures:
        """Return an independent copy."""
        other = object.__new__(Failures)
        other._shape, other._histories = self._shape, self._histories.copy()
        return other


def has_failed(values: Array, state: int, following: int) -> bool:
    """Return whether a transition failed: it led to no state of higher value, by the values (S,) of its plan (thesis 8.1)."""
    return bool(values[following] <= values[state])


def failures_of(space: Space, reaches: Reaches, kind: str) -> Failures | AlikeFailures:
    """Make the memory of failures: "spread" or "local", see `Failures`, or "alike", see `AlikeFailures`.

    Raises UnknownName if there is no such kind.
    """
    if kind not in FAILURES:
        raise UnknownName("kind of failures", kind, FAILURES)
    if kind == "alike":
        return AlikeFailures(space, reaches)
    return Failures(len(space), space.goals.shape[1], reaches.scale, "local" if kind == "local" else "spread")
