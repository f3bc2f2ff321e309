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


def room_for(array: NDArray[Scalar], index: int) -> NDArray[Scalar]:
    """The array, or a copy twice as long where it has no such index."""
    return array if index < len(array) else np.concatenate([array, np.zeros_like(array)])


def forget(found: dict[bytes, Any], most: int) -> None:
    """Delete the entries that were put in first, so that there are fewer than `most`; who puts back what is used keeps the newest."""
    while len(found) >= most:
        del found[next(iter(found))]


class Histories:
    """Histories of so many actions: targets and values.

    Repeats on one target are kept as their sum and number, so that there is one entry for an action and a target, and a
    weighted sum over all of them is one pass of microseconds.

    Args:
        actions: how many.
        scale: m, the unit of the distances.
        near: m, how far from a target others count at all.
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
            self._keys, self._sums = room_for(self._keys, entry), room_for(self._sums, entry)
            self._keys[entry] = key
        self._sums[entry] += value, 1.0

    def average(self, target: Array, prior: float) -> Array:
        """The average of each action's history with one value of `prior` at no distance, shape (actions,).

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
        """One that goes its own way from here."""
        other = Histories(self._actions, self._scale, self._near)
        other._targets, other._known = self._targets.copy(), self._known.copy()
        other._entries, other._keys, other._sums = self._entries.copy(), self._keys.copy(), self._sums.copy()
        return other

    def _index(self, target: Array) -> int:
        key = target.tobytes()
        index = self._known.get(key)
        if index is None:
            index = self._known[key] = len(self._known)
            self._targets = room_for(self._targets, index)
            self._targets[index] = target
        return index


@cache
def _core() -> ModuleType:
    """Loaded when it is first needed."""
    from mobee._core import learning

    return learning
