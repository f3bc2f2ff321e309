"""Nearest-neighbour regression: rewards of reaches from similar poses over similar vectors from hand to target."""

from __future__ import annotations

from typing import Any

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.reaching.histories import forget
from mobee.learning.reaching.predictors.covariance import joint_squares
from mobee.learning.reaching.predictors.observed import Independent, around
from mobee.learning.reaching.reaches import Reaches

NEIGHBOURS = 5
WAY = 0.1  # m: as far apart as one joint at both ends of its samples, divided by:
JOINT = 2.0
CLOSE = 0.05  # squared distance at which a neighbour counts half as much as at none
ONCE = 0.02  # a reach tried once is as unsure as one that its like at this squared distance foretells
STRANGEST = 1e6
IMAGINED = 0.5  # weight of what is expected of all, in neighbours at a squared distance of 1
KEPT = 256  # targets whose neighbours are in memory


class Nearest(Independent):
    """Averages of the five nearest reaches, repeats merged, by their inverse squared distance, drawn to the average of all.

    Args:
        reaches: the reach actions.
    """

    def __init__(self, reaches: Reaches) -> None:
        super().__init__()
        self._reaches = reaches
        self._joints = joint_squares(reaches).sum(axis=0) * JOINT**2
        self._found: dict[bytes, tuple[int, Array, Ints]] = {}

    @property
    def settings(self) -> dict[str, Any]:
        """Its name, as plain JSON values."""
        return {"name": "nearest"}

    def _posterior(self, target: Array) -> tuple[Array, Array]:
        """The deviation is the spread of all mean rewards, less the nearer the neighbours are."""
        middle, variance = around(self._reached)
        far, which = self._neighbours(target)
        weight = 1.0 / (far + CLOSE)
        rewards = np.append(self._reached.mean, middle)[which]
        mean = (IMAGINED * middle + (weight * rewards).sum(axis=1)) / (IMAGINED + weight.sum(axis=1))
        strange = np.minimum(far[:, 0], STRANGEST) + ONCE / np.append(self._reached.count, 1.0)[which[:, 0]]
        deviation: Array = np.sqrt(variance * strange / (1.0 + strange))
        return mean, deviation

    def _neighbours(self, target: Array) -> tuple[Array, Ints]:
        """Squared distances, ascending, and pairs of each state's nearest reaches, shape (S, 5); infinite where there are fewer."""
        key = target.tobytes()
        none = np.full((len(self._reaches), NEIGHBOURS), np.inf), np.full((len(self._reaches), NEIGHBOURS), -1)
        seen, far, which = self._found.pop(key, (0, *none))
        if seen < len(self._reached):
            known, hands = self._reached, self._reaches.hands
            new = slice(seen, len(known))
            state, ways = known.state[new], known.places[known.target[new]] - hands[known.state[new]]
            squares = self._joints[:, state]
            for axis in range(3):
                squares += ((target[axis] - hands[:, axis, None] - ways[:, axis]) / WAY) ** 2
            far = np.concatenate([far, squares], axis=1)
            which = np.concatenate([which, np.broadcast_to(np.arange(seen, len(known)), squares.shape)], axis=1)
            order = np.argsort(far, axis=1, kind="stable")[:, :NEIGHBOURS]
            far, which = np.take_along_axis(far, order, axis=1), np.take_along_axis(which, order, axis=1)
        forget(self._found, KEPT)
        self._found[key] = len(self._reached), far, which
        return far, which
