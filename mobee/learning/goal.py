# SPDX-License-Identifier: Apache-2.0
"""External rewards, for which an agent plans instead of information gain, or in addition to it (thesis 6.5)."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mobee.arrays import Array, Ints, is_number
from mobee.errors import InvalidValue
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.space import Space

Goal = Array | Sequence[int] | Callable[[int, int, int], float]
PURSUING = ("curious",)  # explorers that use an external reward


class External:
    """An external reward R(s, a) for each state s and action a of a space.

    Args:
        space: the states and actions.
        goal: target states, in which all actions have reward 1 (in all others 0); or rewards of shape (S, A); or a function of state,
            action and goal state of the action that returns the reward.
        weight: the external reward times this factor is added to the intrinsic reward; None: it replaces the intrinsic reward.

    Raises:
        InvalidValue: no such state, a reward that is not finite, or a wrong shape.
    """

    def __init__(self, space: Space, goal: Goal, weight: float | None = None) -> None:
        if weight is not None and not (is_number(weight) and math.isfinite(weight)):
            raise InvalidValue(f"goal_weight={weight!r}: give a finite factor, or None to replace the intrinsic reward.")
        self.weight = None if weight is None else float(weight)
        exists = space.goals != NO_ACTION
        rewards = _rewards(space, goal)
        if rewards.shape != exists.shape or not np.isfinite(rewards[exists]).all():
            raise InvalidValue(
                f"goal holds rewards of shape {rewards.shape}, or some that are not finite: give one for each state and action, "
                f"shape {exists.shape}, or target states, or a function of state, action and goal state."
            )
        self.reward: Array = np.where(exists, rewards, -np.inf)
        """R(s, a), shape (S, A), -inf where there is no action (read only)."""
        self.reward.flags.writeable = False

    def combined(self, intrinsic: Array) -> Array:
        """Return the reward with which plans are computed, for each state and action, shape (S, A); -inf where there is no action.

        It is the external reward, or, with a weight, `intrinsic` (S, A) plus weight times the external reward.
        """
        if self.weight is None:
            return self.reward
        return np.where(intrinsic == -np.inf, -np.inf, intrinsic + self.weight * self.reward)

    @property
    def settings(self) -> dict[str, Any]:
        """A hash of the rewards, and their weight, for the record of a run, as JSON values."""
        return {"digest": hashlib.sha256(self.reward.tobytes()).hexdigest()[:16], "weight": self.weight}


def pursued(space: Space, goal: Goal | None, weight: float | None, explorer: str) -> External | None:
    """Return the external reward of an agent; None if there is no goal.

    `goal`, `weight`: as in `External`. `explorer`: name of the method by which the agent chooses actions. Raises InvalidValue if this
    method ignores external rewards, or for a weight without a goal.
    """
    if goal is None:
        if weight is not None:
            raise InvalidValue(f"goal_weight={weight!r} without a goal: give both, or neither.")
        return None
    require_pursuing(explorer)
    return External(space, goal, weight)


def require_pursuing(explorer: str) -> None:
    """Raise InvalidValue if an explorer (a method of choosing actions) ignores external rewards.

    `explorer`: its name. Only "curious", the one name in PURSUING, uses external rewards.
    """
    if explorer not in PURSUING:
        raise InvalidValue(f"the explorer {explorer!r} ignores a goal: take {' or '.join(map(repr, PURSUING))}, or leave the goal out.")


def target_states(space: Space, given: Any) -> Ints:
    """Return the states `given` as one number or several, as an ascending array; raises InvalidValue if the space has no such state."""
    states = np.unique(np.asarray(given))
    if states.dtype.kind not in "iu" or not len(states) or states[0] < 0 or states[-1] >= len(space):
        raise InvalidValue(f"{given!r}: {space.part} has no such state. Valid are 0 to {len(space) - 1}.")
    return states.astype(np.intp)


def _rewards(space: Space, goal: Goal) -> Array:
    if callable(goal):
        rows = [[goal(s, a, int(g)) if g != NO_ACTION else 0.0 for a, g in enumerate(row)] for s, row in enumerate(space.goals)]
        return np.array(rows, dtype=np.float64)
    if np.ndim(goal) >= 2:
        return np.asarray(goal, dtype=np.float64)
    rewards = np.zeros(space.goals.shape)
    rewards[target_states(space, goal)] = 1.0
    return rewards
