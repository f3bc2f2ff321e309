# SPDX-License-Identifier: Apache-2.0
"""Measures an agent's knowledge, and how much it can still learn, from its `Learned` messages."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bus_schema.messages import Learned
from mobee.arrays import Array, Ints
from mobee.learning.beliefs import PREDICTABLE_SHARE, PREDICTABLE_TRIES
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.space import Space


@dataclass(frozen=True, eq=False)
class Knowledge:
    """Numbers of all state-actions of an agent, (S, A): tries, last information gain [nats], value, and where a state has an action.

    `usual`: share of its most frequent outcome.  `n`: transitions.  `state`: where the agent is.
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
        """Share of the state-actions that were tried."""
        return float((self.tries > 0)[self.exists].mean())

    @property
    def predictable(self) -> float:
        """Share of the state-actions that were tried at least twice and ended alike in at least 80 % of the tries."""
        return float(((self.tries >= PREDICTABLE_TRIES) & (self.usual >= PREDICTABLE_SHARE))[self.exists].mean())

    def left(self, first: float) -> Array:
        """Return how much can still be learned in each state, (S,) in 0..1.

        It is the mean information gain of the state's actions, divided by the gain `first` of a first try.
        """
        gain = np.where(self.exists, self.reward, 0.0).sum(axis=1) / np.maximum(self.exists.sum(axis=1), 1)
        left: Array = np.clip(gain / max(first, 1e-12), 0.0, 1.0)
        return left

    def untried(self) -> Ints:
        """Return how many actions of each state were never tried, (S,)."""
        found: Ints = ((self.tries == 0) & self.exists).sum(axis=1)
        return found


def knowledge_of(learned: Learned, space: Space) -> Knowledge | None:
    """Return the knowledge in a message; None if its numbers do not fit the space."""
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
    """Return tries, rewards and values of a message, each of a shape (S, A); None if it has other numbers of them."""
    columns = ((learned.tries, "<u4"), (learned.reward, "<f4"), (learned.value, "<f4"))
    if any(len(data) != 4 * int(np.prod(shape)) for data, _ in columns):
        return None
    tries, reward, value = (np.frombuffer(data, kind).reshape(shape).astype(np.float64) for data, kind in columns)
    return tries, reward, value
