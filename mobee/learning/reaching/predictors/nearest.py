# SPDX-License-Identifier: Apache-2.0
"""Nearest-neighbour regression of rewards, over poses and vectors from hand to target."""

from __future__ import annotations

from typing import Any

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.reaching.histories import forget
from mobee.learning.reaching.predictors.covariance import joint_squares
from mobee.learning.reaching.predictors.observed import Independent, around
from mobee.learning.reaching.reaches import Reaches

NEIGHBOURS = 5
LENGTH_SCALE = 0.1  # m, of vectors from hand to target, for a distance of 1
JOINT_WEIGHT = 2.0  # distance between the two ends of a joint's samples
HALF_WEIGHT = 0.05  # squared distance at which a neighbour has half the weight of one at distance 0
SINGLE_TRY = 0.02  # squared distance of equal uncertainty to a pair that was tried once
MAX_SQUARED = 1e6  # squared distance, for uncertainty
PRIOR_WEIGHT = 0.5  # of the average of all rewards, in neighbours at a squared distance of 1
MAX_CACHED = 256  # targets whose neighbours are in memory


class Nearest(Independent):
    """Predicts a reward by a weighted average of the five nearest reaches: from similar poses, with similar vectors from hand to target.

    The weights are inverse squared distances; the average of all rewards has a small weight too. Repeated reaches count as one.

    Args:
        reaches: for each state, the pose at which a reach begins, and the marker's position in this pose.
    """

    def __init__(self, reaches: Reaches) -> None:
        super().__init__()
        self._reaches = reaches
        self._joints = joint_squares(reaches).sum(axis=0) * JOINT_WEIGHT**2
        self._found: dict[bytes, tuple[int, Array, Ints]] = {}

    @property
    def settings(self) -> dict[str, Any]:
        """The name of the predictor, as JSON values."""
        return {"name": "nearest"}

    def _posterior(self, target: Array) -> tuple[Array, Array]:
        """See Independent; the deviation is that of all mean rewards, and smaller for nearer neighbours."""
        middle, variance = around(self._reached)
        far, which = self._neighbours(target)
        weight = 1.0 / (far + HALF_WEIGHT)
        rewards = np.append(self._reached.mean, middle)[which]
        mean = (PRIOR_WEIGHT * middle + (weight * rewards).sum(axis=1)) / (PRIOR_WEIGHT + weight.sum(axis=1))
        uncertainty = np.minimum(far[:, 0], MAX_SQUARED) + SINGLE_TRY / np.append(self._reached.count, 1.0)[which[:, 0]]
        deviation: Array = np.sqrt(variance * uncertainty / (1.0 + uncertainty))
        return mean, deviation

    def _neighbours(self, target: Array) -> tuple[Array, Ints]:
        """Return squared distances, ascending, and pairs of each state's nearest reaches, shape (S, 5); infinite if there are fewer."""
        key = target.tobytes()
        none = np.full((len(self._reaches), NEIGHBOURS), np.inf), np.full((len(self._reaches), NEIGHBOURS), -1)
        seen, far, which = self._found.pop(key, (0, *none))
        if seen < len(self._reached):
            known, hands = self._reached, self._reaches.hands
            new = slice(seen, len(known))
            state, vectors = known.state[new], known.places[known.target[new]] - hands[known.state[new]]
            squares = self._joints[:, state]
            for axis in range(3):
                squares += ((target[axis] - hands[:, axis, None] - vectors[:, axis]) / LENGTH_SCALE) ** 2
            far = np.concatenate([far, squares], axis=1)
            which = np.concatenate([which, np.broadcast_to(np.arange(seen, len(known)), squares.shape)], axis=1)
            order = np.argsort(far, axis=1, kind="stable")[:, :NEIGHBOURS]
            far, which = np.take_along_axis(far, order, axis=1), np.take_along_axis(which, order, axis=1)
        forget(self._found, MAX_CACHED)
        self._found[key] = len(self._reached), far, which
        return far, which
