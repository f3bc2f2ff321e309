# SPDX-License-Identifier: Apache-2.0
"""Memories of failed transitions; they give negative rewards to transitions that are expected to fail (thesis 8.1).

A failure is evidence about the same transition with all targets or only with near targets, or about similar transitions too.
"""

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
from mobee.reach import TARGET

LENGTH_SCALE = 0.08  # m, of vectors from hand to target
JOINT_SCALE = 0.4  # of the joints, in units of the spread of a joint's samples
PRIOR_WEIGHT = 0.5  # of the overall failure rate, in transitions
MAX_COST = 0.4  # reward lost by a transition that is certain to fail by its similar ones
MAX_SHARE = 0.5  # of the best expected reward, lost by such a transition after a change of the world
MAX_CACHED = 256  # targets whose sums are in memory


def midpoints(space: Space, reaches: Reaches) -> Array:
    """Return the midpoint of each transition, halfway between its start and its goal, shape (S A, 3 + d).

    Row state * A + action belongs to this action of this state. Columns 0 to 2 are the position of the marker (the point of the hand that
    reaches for targets) in units of LENGTH_SCALE (0.08 m), root frame. The last d columns are the positions of the joints; the unit of a
    joint is JOINT_SCALE (0.4) times the range of its positions in the states (largest minus smallest). For an action that does not exist
    the goal is the start.
    """
    goals = np.where(space.goals == NO_ACTION, np.arange(len(space))[:, None], space.goals)
    scaled = reaches.samples / np.maximum(np.ptp(reaches.samples, axis=0), 1e-9) / JOINT_SCALE
    hands, joints = ((one[:, None] + one[goals]) / 2.0 for one in (reaches.hands / LENGTH_SCALE, scaled))
    middles = np.concatenate([hands, joints], axis=2)
    return np.ascontiguousarray(middles.reshape(goals.size, middles.shape[2]))


class AlikeFailures:
    """A memory of failed transitions that also learns about a transition from the failures of similar transitions.

    If a transition was tried with the given target, its reward is the average of its rewards with this target and of one imagined reward
    of 0. Any other transition has a negative reward if similar transitions failed more often than all transitions on average. Two
    transitions are similar if their joint positions, and their vectors from hand to target, are similar. The negative reward is at least
    -MAX_COST (-0.4): large enough that plans avoid the transition if another path costs little, and too small to exclude a state that was
    never tried.

    Args:
        space: states and transitions.
        reaches: position of the hand (of the marker that reaches for targets) in each state.
    """

    def __init__(self, space: Space, reaches: Reaches) -> None:
        self._shape = space.goals.shape
        self._middles = midpoints(space, reaches)
        self._middles[:, :3] *= -1.0  # the origin of the root frame, relative to the hand
        self._events = np.empty((64, self._middles.shape[1] + 1))  # midpoint with the vector from hand to target, and whether it failed
        self._used, self._failed = 0, 0
        self._own: dict[bytes, dict[int, tuple[float, int]]] = {}  # by target and transition: sum and number of rewards
        self._sums: dict[bytes, tuple[int, Array]] = {}  # by target: events in them, failures and weights (2, S A)

    def add(self, state: int, action: int, target: Array, reward: float, touched: tuple[str, ...] = ()) -> None:
        """Record the reward of a transition, an action in a state: 0 if it succeeded, below 0 if it failed.

        `target`: position (3,) m, root frame, of the target that the agent was trying to reach. `touched`: not used.
        """
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

    def rewards(self, target: Array, best: float = np.inf) -> Array:
        """Return the expected reward of each transition while the agent tries to reach a target, shape (S, A), at most 0.

        `target`: position (3,) m, root frame. `best`: not used.
        """
        return self.limited(target, MAX_COST)

    def limited(self, target: Array, max_cost: float) -> Array:
        """Return the result of `rewards`, (S, A), with `max_cost` in place of MAX_COST (0.4).

        A transition that was not tried with this target, and whose similar transitions all failed, has a reward near -max_cost, at least
        -max_cost. `target`: (3,) m, root frame.
        """
        usual = self._failed / (self._used + 1.0)
        failed, weight = self._alike(target)
        more = (failed + PRIOR_WEIGHT * usual) / (weight + PRIOR_WEIGHT) - usual
        worth: Array = np.maximum(more, 0.0) * (-max_cost / (1.0 - usual))
        tried = self._own.get(target.tobytes())
        if tried:
            sums = np.array(list(tried.values()))
            worth[list(tried)] = sums[:, 0] / (1.0 + sums[:, 1])
        return worth.reshape(self._shape)

    def copy(self) -> AlikeFailures:
        """Return a copy; later calls of `add` change only one of the two."""
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
    """A memory of failed transitions; the reward of a transition is a weighted average of its recorded rewards.

    A recorded reward is 0 for a success, and negative for a failure. Its weight decreases with the distance between its target and the
    given target. The average includes one imagined reward of 0.

    Args:
        states, actions: number of states, and largest number of actions of a state.
        scale: unit of distances between targets, m.
        kind: "spread": rewards that were recorded with any target are included (thesis eq. 8.1, with 1 added to its denominator, because
            otherwise one failure would exclude a transition for all targets); "local": only those with a target at most 25 mm away.
    """

    def __init__(self, states: int, actions: int, scale: float, kind: Literal["spread", "local"] = "spread") -> None:
        self._shape = states, actions
        self._histories = Histories(states * actions, scale, NEAR_DISTANCE if kind == "local" else np.inf)

    def add(self, state: int, action: int, target: Array, reward: float, touched: tuple[str, ...] = ()) -> None:
        """Record the reward of a transition, an action in a state: 0 if it succeeded, below 0 if it failed.

        `target`: position (3,) m, root frame, of the target that the agent was trying to reach. `touched`: not used.
        """
        self._histories.add(state * self._shape[1] + action, target, reward)

    def rewards(self, target: Array, best: float = np.inf) -> Array:
        """Return the expected reward of each transition while the agent tries to reach a target, shape (S, A), at most 0.

        `target`: position (3,) m, root frame. `best`: not used.
        """
        return self._histories.average(target, 0.0).reshape(self._shape)

    def limited(self, target: Array, max_cost: float) -> Array:
        """Return the result of `rewards`; `max_cost`: not used, because this memory learns nothing from similar transitions."""
        return self.rewards(target)

    def copy(self) -> Failures:
        """Return a copy; later calls of `add` change only one of the two."""
        other = object.__new__(Failures)
        other._shape, other._histories = self._shape, self._histories.copy()
        return other


def has_failed(values: Array, state: int, following: int) -> bool:
    """Return whether a transition failed: the state `following`, to which it led, has no higher value than `state` (thesis 8.1).

    `values`: (S,) values of the states in the plan.
    """
    return bool(values[following] <= values[state])


class FailuresSinceChange:
    """A memory of failures that also learns which transitions are blocked for all targets since a change of the world.

    Before the first change, the reward of a transition is that of the memory `usual`. After a change, it is the lower of two rewards: that
    of `usual`, and a second one, which is the same for all targets. The second reward depends only on transitions since the last change.
    Those that ended in contact with the target are left out, because the target may have blocked them. For a transition that was tried
    since the change, the second reward is the average of its rewards and of one imagined reward of 0. For any other transition it comes
    from the failures of similar transitions, as in `AlikeFailures`; similar means similar joint positions and a similar position of the
    hand in the root frame.

    Args:
        space: states and transitions.
        reaches: position of the hand (of the marker that reaches for targets) in each state.
        usual: the memory to which all transitions are added, also those before a change.
    """

    def __init__(self, space: Space, reaches: Reaches, usual: Failures | AlikeFailures) -> None:
        self._usual, self._shape, self._middles = usual, space.goals.shape, midpoints(space, reaches)
        self._since: list[tuple[int, float]] = []  # transitions that touched no target, and their rewards, since the last change
        self._changed = False
        self._clear()

    def add(self, state: int, action: int, target: Array, reward: float, touched: tuple[str, ...] = ()) -> None:
        """Record the reward of a transition, an action in a state: 0 if it succeeded, below 0 if it failed.

        `target`: position (3,) m, root frame, of the target that the agent was trying to reach. `touched`: names of the world objects in
        contact at the end.
        """
        self._usual.add(state, action, target, reward)
        if not by_target(touched):
            self._since.append((state * self._shape[1] + action, reward))
            if self._changed:
                self._learn(*self._since[-1])

    def change(self, transitions: int) -> None:
        """Record that the world changed before the last `transitions` transitions.

        This number does not include transitions that ended in contact with the target.
        """
        self._since = self._since[max(0, len(self._since) - transitions) :]
        self._changed = True
        self._clear()
        for one in self._since:
            self._learn(*one)

    def blocked(self, state: int, action: int) -> float:
        """Return the probability that the world, since its change, blocks the transition by `action` from `state`; 0 before any change."""
        if not self._changed:
            return 0.0
        transition = state * self._shape[1] + action
        _, count, failed = self._own.get(transition, (0.0, 0, 0))
        return float((failed + self._alike()[transition]) / (count + 1.0))

    def rewards(self, target: Array, best: float = np.inf) -> Array:
        """Return the expected reward of each transition while the agent tries to reach a target, shape (S, A), at most 0.

        `target`: position (3,) m, root frame. `best`: largest expected reward of a reach for this target, over all states. After a change,
        a transition that only resembles failed ones costs at most half of it: where all rewards are small, a larger cost would separate the
        agent from states that it can reach.
        """
        if not self._changed:
            return self._usual.rewards(target)
        max_cost = min(MAX_COST, MAX_SHARE * best)
        usual = self._usual.limited(target, max_cost)
        rate = self._failed / (len(self._since) + 1.0)
        worth: Array = np.maximum(self._alike() - rate, 0.0) * (-max_cost / (1.0 - rate))
        if self._own:
            sums = np.array(list(self._own.values()))
            worth[list(self._own)] = sums[:, 0] / (1.0 + sums[:, 1])
        return np.minimum(usual, worth.reshape(self._shape))

    def copy(self) -> FailuresSinceChange:
        """Return a copy; later calls of `add` and `change` change only one of the two."""
        other = object.__new__(FailuresSinceChange)
        other.__dict__.update(self.__dict__)
        other._usual, other._since = self._usual.copy(), self._since.copy()
        other._own, other._sums = self._own.copy(), self._sums.copy()
        return other

    def _clear(self) -> None:
        self._own: dict[int, tuple[float, int, int]] = {}  # by transition: sum and number of rewards, number of failures
        self._sums = np.zeros((2, len(self._middles)))  # failures of similar transitions, and all of them
        self._failed = 0

    def _learn(self, transition: int, reward: float) -> None:
        total, count, failed = self._own.get(transition, (0.0, 0, 0))
        self._own[transition] = total + reward, count + 1, failed + (reward < 0.0)
        self._failed += reward < 0.0
        _core().gaussian_sums(self._middles, np.append(self._middles[transition], float(reward < 0.0))[None], self._sums)

    def _alike(self) -> Array:
        """Return, for each transition, the rate at which similar transitions failed since the change, shape (S A,).

        Index state * A + action belongs to this action of this state. Transitions are similar if their `midpoints` are near.
        """
        (failed, weight), rate = self._sums, self._failed / (len(self._since) + 1.0)
        alike: Array = (failed + PRIOR_WEIGHT * rate) / (weight + PRIOR_WEIGHT)
        return alike


def by_target(touched: tuple[str, ...]) -> bool:
    """Return whether the target may have caused the failure of a transition, that is, whether it is among the objects touched at the end.

    `touched`: names of the world objects in contact at the end of the transition.
    """
    return TARGET in touched


def failures_of(space: Space, reaches: Reaches, kind: str) -> Failures | AlikeFailures:
    """Make an empty memory of failed transitions.

    `reaches`: position of the hand in each state, and unit of distances. `kind`: "spread": a `Failures` that learns about a transition from
    its tries with all targets; "local": a `Failures` that learns only from its tries with near targets; "alike": an `AlikeFailures`, which
    learns from similar transitions too. Raises UnknownName if there is no such kind.
    """
    if kind not in FAILURES:
        raise UnknownName("kind of failures", kind, FAILURES)
    if kind == "alike":
        return AlikeFailures(space, reaches)
    return Failures(len(space), space.goals.shape[1], reaches.scale, "local" if kind == "local" else "spread")
