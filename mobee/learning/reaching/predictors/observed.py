# SPDX-License-Identifier: Apache-2.0
"""The reaches so far, repeats merged, and the base of predictors that treat states independently."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.reaching.histories import grown

EXPECTED, SPREAD = 0.3, 0.25  # average and standard deviation of mean rewards before the first reach
IMAGINED = 4.0  # weight of these two, in pairs


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
        """The number of reaches observed for each pair of state and target, shape (n,)."""
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
        """Return the index of a target among the distinct ones; None: never tried."""
        return self._target_of.get(target.tobytes())

    def pair(self, state: int, target: Array) -> int | None:
        """Return the index of a pair of state and target; None: never tried."""
        known = self.find(target)
        return None if known is None else self._pair_of.get((state, known))

    def add(self, state: int, target: Array, reward: float) -> int:
        """Add one reach; return the index of its pair of state and target, which is new at the first try."""
        key = target.tobytes()
        place = self._target_of.setdefault(key, len(self._target_of))
        self._places = grown(self._places, place)
        self._places[place] = target
        pair = self._pair_of.setdefault((state, place), len(self._pair_of))
        self._state, self._target = grown(self._state, pair), grown(self._target, pair)
        self._count, self._total, self._squares = grown(self._count, pair), grown(self._total, pair), grown(self._squares, pair)
        self._state[pair], self._target[pair] = state, place
        self._count[pair] += 1.0
        self._total[pair] += reward
        self._squares[pair] += reward * reward
        self.tries += 1
        return pair


def around(known: Reached) -> tuple[float, float]:
    """Return average and variance of the mean rewards; a few imagined rewards are included, so that both exist from the start."""
    rewards, pairs = known.mean, len(known) + IMAGINED
    middle = (rewards.sum() + IMAGINED * EXPECTED) / pairs
    return float(middle), float((((rewards - middle) ** 2).sum() + IMAGINED * SPREAD**2) / pairs)


class Independent(ABC):
    """Base of predictors with independent normal distributions of the mean rewards, computed from the reaches in `_reached`."""

    def __init__(self) -> None:
        self._reached = Reached()

    @property
    @abstractmethod
    def settings(self) -> dict[str, Any]:
        """Settings that determine its predictions, as plain JSON values."""

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn from a reach."""
        self._reached.add(state, target, reward)

    def mean(self, target: Array) -> Array:
        """Return the expected reward of reaching from each state, shape (S,)."""
        return self._posterior(target)[0]

    def deviation(self, target: Array) -> Array:
        """Return the standard deviations of the mean rewards, shape (S,)."""
        return self._posterior(target)[1]

    def sample(self, target: Array, rng: np.random.Generator) -> Array:
        """Return one independent draw of each mean reward, shape (S,)."""
        drawn: Array = rng.normal(*self._posterior(target))
        return drawn

    @abstractmethod
    def _posterior(self, target: Array) -> tuple[Array, Array]:
        """Return means and standard deviations of the mean rewards for a target (3,) m, each (S,), which the caller may change."""
