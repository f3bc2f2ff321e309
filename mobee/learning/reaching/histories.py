# SPDX-License-Identifier: Apache-2.0
"""Stores observed values, such as rewards, by action and target, and averages the values of each action (thesis eqs. 8.1, 8.5, 8.7).

In an average, values that were observed with distant targets have small weights.
"""

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
    """Return an array in which `index` is valid: the given one, or a copy of twice the length, whose second half is 0."""
    return array if index < len(array) else np.concatenate([array, np.zeros_like(array)])


def forget(found: dict[bytes, Any], most: int) -> None:
    """Delete the oldest entries of the dict `found` until fewer than `most` remain, to limit the size of a cache.

    The oldest entry is the one inserted first. Callers delete and insert an entry at each use, so that the entry used least recently is
    deleted.
    """
    while len(found) >= most:
        del found[next(iter(found))]


class Histories:
    """For each action, the values that were observed, each with the target to which it belongs.

    Values of one action with one target are stored as their sum and number. So a weighted sum over all entries takes microseconds.

    Args:
        actions: number of actions.
        scale: unit of distances between targets, m.
        near: m; `average` ignores values whose target is farther than this from the target given to it.
    """

    def __init__(self, actions: int, scale: float, near: float = np.inf) -> None:
        self._actions, self._scale, self._near = actions, scale, near
        self._targets = np.empty((4, 3))
        self._known: dict[bytes, int] = {}
        self._entries: dict[tuple[int, int], int] = {}
        self._keys = np.empty((4, 2), dtype=np.int64)
        self._sums = np.zeros((4, 2))

    def add(self, action: int, target: Array, value: float) -> None:
        """Record a value, such as a reward, that was observed when an action was tried with a target.

        `target`: position (3,) m, root frame. Raises InvalidValue if there is no such action.
        """
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
        """Return for each action the weighted average of its values and of one value `prior`, shape (actions,).

        The weight of a value is 1 / (1 + distance / `scale`), with the distance between its target and `target` (3,) m; a value with a
        distance above `near` is ignored. The weight of `prior` is 1. A prior of 1 gives thesis eqs. 8.5 and 8.7; 0 gives eq. 8.1 with 1
        added to the denominator.
        """
        totals, weights = sums = np.ones((2, self._actions))
        totals[:] = prior
        where = np.ascontiguousarray(target, dtype=np.float64).reshape(3)
        sizes, weighing = (len(self._known), len(self._entries)), (self._scale, self._near)
        _core().weighted_sums(self._targets, self._keys, self._sums, sizes, weighing, where, sums)
        found: Array = totals / weights
        return found

    def copy(self) -> Histories:
        """Return a copy; later calls of `add` change only one of the two."""
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
