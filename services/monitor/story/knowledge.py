# SPDX-License-Identifier: Apache-2.0
"""Measures an agent's knowledge, and how much it can still learn, from its `Learned` messages."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bus_schema.messages import Learned
from mobee.arrays import Array, Ints
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.space import Space
from mobee.learning.value_iteration import PREDICTABLE_SHARE, PREDICTABLE_TRIES


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What an agent knows about its state-actions. All arrays are (S, A): S states with at most A actions each.

    `exists`: whether the state has the action. `tries`: number of tries. `reward`: information gain of the last try [nats]. `value`: action
    value, -inf where there is no action. `usual`: share of the tries that had the most frequent outcome. `n`: number of transitions that
    the agent has observed. `state`: the agent's present state.
    """

    exists: NDArray[np.bool_]
    tries: Ints
    reward: Array
    value: Array
    usual: Array
    n: int
    state: int

    @property
    def tried(self) -> float:
        """The share of the state-actions that were tried, 0 to 1."""
        return float((self.tries > 0)[self.exists].mean())

    @property
    def predictable(self) -> float:
        """The share of the state-actions that are predictable, 0 to 1.

        A state-action is predictable if it was tried at least twice, with the same outcome in at least 80 % of the tries.
        """
        return float(((self.tries >= PREDICTABLE_TRIES) & (self.usual >= PREDICTABLE_SHARE))[self.exists].mean())

    def left(self, first: float) -> Array:
        """Return how much can still be learned in each state, (S,), 0 to 1.

        It is the mean information gain of the state's actions, divided by `first`, the gain of a first try [nats].
        """
        gain = np.where(self.exists, self.reward, 0.0).sum(axis=1) / np.maximum(self.exists.sum(axis=1), 1)
        left: Array = np.clip(gain / max(first, 1e-12), 0.0, 1.0)
        return left

    def untried(self) -> Ints:
        """Return, for each state, how many of its actions were never tried, (S,)."""
        found: Ints = ((self.tries == 0) & self.exists).sum(axis=1)
        return found


def knowledge_of(learned: Learned, space: Space) -> Knowledge | None:
    """Return the knowledge that a `Learned` message contains; None if its arrays do not have the size of the space."""
    shape = space.goals.shape
    found = numbers_of(learned, shape)
    if found is None or learned.s >= shape[0]:
        return None
    tries, reward, value = found
    exists = space.goals != NO_ACTION
    missed, most = np.zeros(shape), np.zeros(shape)
    for one in learned.surprises:
        if one.s < shape[0] and one.a < shape[1]:
            missed[one.s, one.a] += one.share
            most[one.s, one.a] = max(most[one.s, one.a], one.share)
    usual = np.maximum(np.clip(1.0 - missed, 0.0, 1.0), most)
    finite = np.where(exists, reward, 0.0)
    return Knowledge(exists, tries.astype(np.int64), finite, np.where(exists, value, -np.inf), usual, learned.n, learned.s)


def numbers_of(learned: Learned, shape: tuple[int, ...]) -> tuple[Array, Array, Array] | None:
    """Decode the tries, rewards and action values of a `Learned` message as three arrays of the given shape (S, A).

    Returns None if the message has another number of values.
    """
    columns = ((learned.tries, "<u4"), (learned.reward, "<f4"), (learned.value, "<f4"))
    if any(len(data) != 4 * int(np.prod(shape)) for data, _ in columns):
        return None
    tries, reward, value = (np.frombuffer(data, kind).reshape(shape).astype(np.float64) for data, kind in columns)
    return tries, reward, value
