"""All reaches so far, repeats of one state and target merged: what most predictors learn from."""

from __future__ import annotations

import numpy as np

from mobee.learning.reaching.room import room_for
from mobee.robot.robot import Array, Ints

EXPECTED, SPREAD = 0.3, 0.25  # of mean rewards before the first reach: average and standard deviation
IMAGINED = 4.0  # pairs that these count for


class Reached:
    """Pairs of a state and a target in the order of their first reaches, with the number, sum and squares of their rewards."""

    def __init__(self) -> None:
        self._target_of: dict[bytes, int] = {}
        self._pair_of: dict[tuple[int, int], int] = {}
        self._places = np.empty((8, 3))
        self._state, self._target = np.empty(8, dtype=np.intp), np.empty(8, dtype=np.intp)
        self._count, self._total, self._squares = np.zeros(8), np.zeros(8), np.zeros(8)
        self.tries = 0
        """Reaches so far, repeats included."""

    def __len__(self) -> int:
        return len(self._pair_of)

    @property
    def places(self) -> Array:
        """Distinct targets, shape (T, 3), in m."""
        return self._places[: len(self._target_of)]

    @property
    def state(self) -> Ints:
        """State of each pair, shape (n,)."""
        return self._state[: len(self)]

    @property
    def target(self) -> Ints:
        """Index among the distinct targets of each pair, shape (n,)."""
        return self._target[: len(self)]

    @property
    def count(self) -> Array:
        """How often each pair was tried, shape (n,)."""
        return self._count[: len(self)]

    @property
    def mean(self) -> Array:
        """Average reward of each pair, shape (n,)."""
        average: Array = self._total[: len(self)] / self.count
        return average

    @property
    def scatter(self) -> float:
        """Sum over all reaches of the squared difference from the average of their pair."""
        within = self._squares[: len(self)] - self._total[: len(self)] ** 2 / self.count
        return float(np.maximum(within, 0.0).sum())

    def find(self, target: Array) -> int | None:
        """Index of a target among the distinct ones; None: never reached for."""
        return self._target_of.get(target.tobytes())

    def pair(self, state: int, target: Array) -> int | None:
        """Index of a pair; None: never tried."""
        known = self.find(target)
        return None if known is None else self._pair_of.get((state, known))

    def add(self, state: int, target: Array, reward: float) -> int:
        """Take one reach; returns the index of its pair."""
        key = target.tobytes()
        place = self._target_of.setdefault(key, len(self._target_of))
        self._places = room_for(self._places, place)
        self._places[place] = target
        pair = self._pair_of.setdefault((state, place), len(self._pair_of))
        self._state, self._target = room_for(self._state, pair), room_for(self._target, pair)
        self._count, self._total, self._squares = room_for(self._count, pair), room_for(self._total, pair), room_for(self._squares, pair)
        self._state[pair], self._target[pair] = state, place
        self._count[pair] += 1.0
        self._total[pair] += reward
        self._squares[pair] += reward * reward
        self.tries += 1
        return pair


def around(known: Reached) -> tuple[float, float]:
    """Average and variance of the mean rewards, with a few imagined ones so that they exist from the start."""
    rewards, pairs = known.mean, len(known) + IMAGINED
    middle = (rewards.sum() + IMAGINED * EXPECTED) / pairs
    return float(middle), float((((rewards - middle) ** 2).sum() + IMAGINED * SPREAD**2) / pairs)
