# SPDX-License-Identifier: Apache-2.0
"""Histories of values by state and target, and their averages weighted by distance (thesis eqs. 8.1, 8.5, 8.7)."""

from __future__ import annotations

from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.transitions import Scalar


def grown(array: NDArray[Scalar], index: int) -> NDArray[Scalar]:
    """Return the array, or, if the index is beyond its end, a copy of twice the length that is filled with zeros."""
    return array if index < len(array) else np.concatenate([array, np.zeros_like(array)])


def forget(found: dict[bytes, Any], most: int) -> None:
    """Delete the entries inserted first until there are fewer than `most`; callers insert an entry again at each use, to keep it longer."""
    while len(found) >= most:
        del found[next(iter(found))]


class Histories:
    """The values of each action with their targets.

    Repeats on one target are stored as their sum and number: one entry for an action and a target, so that a weighted sum over all
    entries takes microseconds.

    Args:
        actions: their number.
        scale: m, unit of the distances.
        near: m, distance from a target beyond which other targets are ignored.
    """

    def __init__(self, actions: int, scale: float, near: float = np.inf) -> None:
        self._actions, self._scale, self._near = actions, scale, near
        self._targets = np.empty((4, 3))
        self._known: dict[bytes, int] = {}
        self._entries: dict[tuple[int, int], int] = {}
        self._keys = np.empty((4, 2), dtype=np.int64)
        self._sums = np.zeros((4, 2))

    def add(self, action: int, target: Array, value: float) -> None:
        """Append a value to the history of an action; target (3,) m."""
        if not 0 <= action < self._actions:
            raise InvalidValue(f"action {action!r}: valid are 0 to {self._actions - 1}.")
        key = action, self._index(target)
        entry = self._entries.get(key)
        if entry is None:
            entry = self._entries[key] = len(self._entries)
            self._keys, self._sums = grown(self._keys, entry), grown(self._sums, entry)
            self._keys[entry] = key
        self._sums[entry] += value, 1.0

    def average(self, target: Array, prior: float) -> Array:
        """Return the weighted average of each action's history and one value `prior` at distance 0, shape (actions,).

        Weights are 1 / (1 + |x - x_i|).  A prior of 1 gives thesis eqs. 8.5 and 8.7; 0 gives eq. 8.1 with 1 added to the denominator.
        """
        totals, weights = sums = np.ones((2, self._actions))
        totals[:] = prior
        where = np.ascontiguousarray(target, dtype=np.float64).reshape(3)
        sizes, weighing = (len(self._known), len(self._entries)), (self._scale, self._near)
        _core().weighted_sums(self._targets, self._keys, self._sums, sizes, weighing, where, sums)
        found: Array = totals / weights
        return found

    def copy(self) -> Histories:
        """Return an independent copy."""
        other = Histories(self._actions, self._scale, self._near)
        other._targets, other._known = self._targets.copy(), self._known.copy()
        other._entries, other._keys, other._sums = self._entries.copy(), self._keys.copy(), self._sums.copy()
        return other

    def _index(self, target: Array) -> int:
        key = target.tobytes()
        index = self._known.get(key)
        if index is None:
            index = self._known[key] = len(self._known)
            self._targets = grown(self._targets, index)
            self._targets[index] = target
        return index


@cache
def _core() -> ModuleType:
    """Import the native functions when they are first needed."""
    from mobee._core import learning

    return learning
