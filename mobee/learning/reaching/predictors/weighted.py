# SPDX-License-Identifier: Apache-2.0
"""The published predictor of the reward of a reach (a motion in which a force pulls the hand to a target).

It is the average of the rewards of earlier reaches from the same state, weighted by the distance between targets (thesis eq. 8.5).
"""

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
    """The predictor of the thesis: for each state, the average reward of the reaches from it, in which nearer targets have more weight.

    It is optimistic, because each average includes an imagined reward of 1: the prediction is 1 for a state that was never tried, and
    nearly 1 for targets far from those that were tried.

    Args:
        reaches: the reach actions, one for each state; only their number and `scale`, the unit of distances [m], are used.
    """

    def __init__(self, reaches: Reaches) -> None:
        self._scale = reaches.scale
        self._rewards = Histories(len(reaches), reaches.scale)

    @property
    def settings(self) -> dict[str, Any]:
        """The name of the predictor, and the unit of distances `scale` in m, as JSON values."""
        return {"name": "weighted", "scale": self._scale}

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Append the reward of a reach to the history of its state (thesis eq. 8.2). `target`: (3,) m, root frame; `expected`: unused."""
        self._rewards.add(state, target, reward)

    def mean(self, target: Array) -> Array:
        """Return the expected reward of a reach from each state for a target (3,) m, root frame; shape (S,), thesis eq. 8.5."""
        return self._rewards.average(target, 1.0)

    def deviation(self, target: Array) -> NoReturn:
        """Raise InvalidValue: this predictor has no standard deviations."""
        raise InvalidValue(_NO_DEVIATION)

    def sample(self, target: Array, rng: np.random.Generator) -> NoReturn:
        """Raise InvalidValue: this predictor has no distribution from which to draw a sample."""
        raise InvalidValue(_NO_DEVIATION)
