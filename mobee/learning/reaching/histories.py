"""What each action brought on which target, and averages of that, weighted by how near the targets were (thesis eq. 8.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mobee.learning.bins import Scalar
from mobee.robot.robot import Array


class Histories:
    """Histories of so many actions: targets and values.

    Repeats on one target are kept as their number and sum, so that a history never grows beyond one entry an action and
    target, and a weighted sum over all of them is one compiled pass.

    Args:
        actions: how many.
        scale: m, the unit of the distances.
    """

    def __init__(self, actions: int, scale: float) -> None:
        self._actions, self._scale = actions, scale
        self._targets = np.empty((4, 3))
        self._known: dict[bytes, int] = {}
        self._entry: dict[tuple[int, int], int] = {}
        self._action, self._target = np.empty(4, dtype=np.int64), np.empty(4, dtype=np.int64)
        self._total, self._count = np.zeros(4), np.zeros(4)

    def add(self, action: int, target: Array, value: float) -> None:
        """Append a value to the history of an action; target (3,) m."""
        key = action, self._index(target)
        entry = self._entry.get(key)
        if entry is None:
            entry = self._entry[key] = len(self._entry)
            self._action, self._target = _room(self._action, entry), _room(self._target, entry)
            self._total, self._count = _room(self._total, entry), _room(self._count, entry)
            self._action[entry], self._target[entry] = key
        self._total[entry] += value
        self._count[entry] += 1.0

    def weighted(self, target: Array) -> tuple[Array, Array]:
        """Sums over each action's history of weight times value, and of the weights, shape (actions,): 1 / (1 + |x - x_i|)."""
        used = len(self._entry)
        offsets = self._targets[: len(self._known)] - target
        weights = 1.0 / (1.0 + np.sqrt(np.einsum("ij,ij->i", offsets, offsets)) / self._scale)
        weight, action = weights[self._target[:used]], self._action[:used]
        total: Array = np.bincount(action, weight * self._total[:used], self._actions).astype(np.float64, copy=False)
        return total, np.bincount(action, weight * self._count[:used], self._actions).astype(np.float64, copy=False)

    def optimistic(self, target: Array) -> Array:
        """Weighted averages over each action's history and one value of 1 at no distance, shape (actions,) (thesis eqs. 8.5 and 8.7)."""
        total, weight = self.weighted(target)
        average: Array = (1.0 + total) / (1.0 + weight)
        return average

    def _index(self, target: Array) -> int:
        key = target.tobytes()
        index = self._known.get(key)
        if index is None:
            index = self._known[key] = len(self._known)
            self._targets = _room(self._targets, index)
            self._targets[index] = target
        return index


def _room(array: NDArray[Scalar], index: int) -> NDArray[Scalar]:
    """The array, or a copy twice as long where it has no such index."""
    return array if index < len(array) else np.concatenate([array, np.zeros_like(array)])
