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

WAY = 0.08  # m: as far apart as
JOINT = 0.4  # of the spread of a joint's samples
IMAGINED = 0.5  # transitions that failed as often as all do
DETOUR = 0.4  # reward that avoiding a transition which fails for sure is worth
KEPT = 256  # targets whose sums are in memory


class AlikeFailures:
    """What was tried on a target counts as it is; of all else, how often transitions like it failed.

    A transition that was tried on this very target is worth the average of its rewards and one of 0.  Another is worth less than
    0 by as much as its like failed more often than transitions do on the whole, `DETOUR` at most: enough to go round it where
    that costs little, not enough to shut a state off that nobody has tried to come to.

    Args:
        space: states and transitions.
        reaches: where the marker is in each state.
    """

    def __init__(self, space: Space, reaches: Reaches) -> None:
        self._shape = space.goals.shape
        goals = np.where(space.goals == NO_ACTION, np.arange(len(space))[:, None], space.goals)
        scaled = reaches.samples / np.maximum(np.ptp(reaches.samples, axis=0), 1e-9) / JOINT
        hands, joints = ((one[:, None] + one[goals]) / 2.0 for one in (reaches.hands / WAY, scaled))
        middles = np.concatenate([-hands, joints], axis=2)
        self._middles: Array = np.ascontiguousarray(middles.reshape(goals.size, middles.shape[2]))  # half-way, from the hand
        self._events = np.empty((64, self._middles.shape[1] + 1))  # the same from the hand to the target, and whether it failed
        self._used, self._failed = 0, 0
        self._own: dict[bytes, dict[int, tuple[float, int]]] = {}  # by target and transition: sum and number of rewards
        self._sums: dict[bytes, tuple[int, Array]] = {}  # by target: events in them, failures and weights (2, S A)

    def add(self, state: int, action: int, target: Array, reward: float) -> None:
        """Take the reward of a transition made while a target (3,) m was presented."""
        transition, tried = state * self._shape[1] + action, self._own.setdefault(target.tobytes(), {})
        total, count = tried.get(transition, (0.0, 0))
        tried[transition] = total + reward, count + 1
        if self._used == len(self._events):
            self._events = np.concatenate([self._events, np.empty_like(self._events)])
        event = self._events[self._used]
        event[:-1], event[-1] = self._middles[transition], reward < 0.0
        event[:3] += target / WAY
        self._used += 1
        self._failed += reward < 0.0

    def rewards(self, target: Array) -> Array:
        """What each transition is worth, shape (S, A), at most 0."""
        usual = self._failed / (self._used + 1.0)
        failed, weight = self._alike(target)
        more = (failed + IMAGINED * usual) / (weight + IMAGINED) - usual
        worth: Array = np.maximum(more, 0.0) * (-DETOUR / (1.0 - usual))
        tried = self._own.get(target.tobytes())
        if tried:
            sums = np.array(list(tried.values()))
            worth[list(tried)] = sums[:, 0] / (1.0 + sums[:, 1])
        return worth.reshape(self._shape)

    def copy(self) -> AlikeFailures:
        """One that goes its own way from here."""
        other = object.__new__(AlikeFailures)
        other.__dict__.update(self.__dict__)
        other._events, other._sums = self._events.copy(), self._sums.copy()
        other._own = {target: tried.copy() for target, tried in self._own.items()}
        return other

    def _alike(self, target: Array) -> Array:
        """Over what happened to transitions: weights times failures, and weights, shape (2, S A)."""
        key = target.tobytes()
        seen, sums = self._sums.pop(key, (0, np.zeros((2, len(self._middles)))))
        if seen < self._used:
            sums, asked = sums.copy(), self._middles.copy()
            asked[:, :3] += target / WAY
            _core().gaussian_sums(asked, self._events[seen : self._used], sums)
        forget(self._sums, KEPT)
        self._sums[key] = self._used, sums
        return sums


@cache
def _core() -> ModuleType:
    """Loaded when it is first needed."""
    from mobee._core import learning

    return learning


FAILURES = ("spread", "local", "alike")
NEAR = 0.025  # m: targets of the published size this near one another are in the way of nearly the same


class Failures:
    """Histories of all transitions: 0 for each success and a penalty for each failure, by target.

    Args:
        states, actions: of the space.
        scale: m, the unit of distances.
        kind: "spread": every failure tells a little of every target (thesis eq. 8.1, with 1 added to its denominator, or one failure
            would forbid a transition on all targets); "local": it tells of targets within 25 mm alone.
    """

    def __init__(self, states: int, actions: int, scale: float, kind: Literal["spread", "local"] = "spread") -> None:
        self._shape = states, actions
        self._histories = Histories(states * actions, scale, NEAR if kind == "local" else np.inf)

    def add(self, state: int, action: int, target: Array, reward: float) -> None:
        """Append the reward of a transition made while a target (3,) m was presented."""
        self._histories.add(state * self._shape[1] + action, target, reward)

    def rewards(self, target: Array) -> Array:
        """The expected reward of each transition, shape (S, A), at most 0."""
        return self._histories.average(target, 0.0).reshape(self._shape)

    def copy(self) -> Failures:
        """One that goes its own way from here."""
        other = object.__new__(Failures)
        other._shape, other._histories = self._shape, self._histories.copy()
        return other


def has_failed(values: Array, state: int, following: int) -> bool:
    """Whether a transition did not climb the values (S,) of the plan that it was part of (thesis 8.1)."""
    return bool(values[following] <= values[state])


def failures_of(space: Space, reaches: Reaches, kind: str) -> Failures | AlikeFailures:
    """What remembers failures in that way: "spread", "local", see `Failures`, or "alike", see `AlikeFailures`.

    Raises UnknownName if there is no such way.
    """
    if kind not in FAILURES:
        raise UnknownName("way to remember failures", kind, FAILURES)
    if kind == "alike":
        return AlikeFailures(space, reaches)
    return Failures(len(space), space.goals.shape[1], reaches.scale, "local" if kind == "local" else "spread")
