# SPDX-License-Identifier: Apache-2.0
"""A predictor without generalisation: a table with the mean reward of each state and target."""

from __future__ import annotations

from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.learning.reaching.predictors.observed import IMAGINED, Independent, around
from mobee.learning.reaching.reaches import Reaches

NOISE = 0.05  # standard deviation of a reward around its mean, before there are repeats


class Table(Independent):
    """Predicts the reward of a reach as a weighted mean of the mean reward of its pair (state, target) and the average over all pairs.

    The fewer rewards a pair has, the more weight the average over all pairs has. The model: the mean rewards of pairs are normally
    distributed around this average, and the rewards of a pair around its mean reward.

    Args:
        reaches: the reach actions, one for each state; only their number is used.
    """

    def __init__(self, reaches: Reaches) -> None:
        super().__init__()
        self._states = len(reaches)

    @property
    def settings(self) -> dict[str, Any]:
        """A dict with one key, "name": the name of the predictor."""
        return {"name": "table"}

    def _posterior(self, target: Array) -> tuple[Array, Array]:
        known = self._reached
        middle, spread = around(known)
        noise = (known.scatter + IMAGINED * NOISE**2) / (known.tries - len(known) + IMAGINED)
        count, mean = np.zeros(self._states), np.full(self._states, middle)
        place = known.find(target)
        if place is not None:
            here = known.target == place
            count[known.state[here]], mean[known.state[here]] = known.count[here], known.mean[here]
        precision = 1.0 / spread + count / noise
        return (middle / spread + count * mean / noise) / precision, np.sqrt(1.0 / precision)
