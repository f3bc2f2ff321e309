# SPDX-License-Identifier: Apache-2.0
"""The published predictor: averages over a state's history weighted by the distance of targets (thesis eq. 8.5)."""

from __future__ import annotations

from typing import Any, NoReturn

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.reaching.histories import Histories
from mobee.learning.reaching.reaches import Reaches

_NO_DEVIATION = (
    "the published predictor has no deviation and no distribution: explore with intrinsic, greedy or random, or take another predictor."
)


class Weighted:
    """Predicts optimistic weighted averages: 1 for a state that was never tried, and nearly 1 for targets far from those tried.

    Args:
        reaches: the reach actions.
    """

    def __init__(self, reaches: Reaches) -> None:
        self._scale = reaches.scale
        self._rewards = Histories(len(reaches), reaches.scale)

    @property
    def settings(self) -> dict[str, Any]:
        """Its name and the unit of distances, as plain JSON values."""
        return {"name": "weighted", "scale": self._scale}

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Append a reach to the history of its state (thesis eq. 8.2)."""
        self._rewards.add(state, target, reward)

    def mean(self, target: Array) -> Array:
        """Return the expected reward of reaching from each state, shape (S,) (thesis eq. 8.5)."""
        return self._rewards.average(target, 1.0)

    def deviation(self, target: Array) -> NoReturn:
        """Raise InvalidValue: an average has no deviation."""
        raise InvalidValue(_NO_DEVIATION)

    def sample(self, target: Array, rng: np.random.Generator) -> NoReturn:
        """Raise InvalidValue: there is no distribution to draw from."""
        raise InvalidValue(_NO_DEVIATION)
