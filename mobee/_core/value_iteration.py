"""Value iteration over tables of outcomes; declares core/value_iteration.cpp."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from ctypes import addressof

import numpy as np
from numpy.typing import NDArray

from mobee._core import ADDRESS, INTEGER, REAL, address, function

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

BAD_REWARD, BAD_OUTCOME, BAD_START = -1, -2, -3  # instead of the number of sweeps


class Table(ctypes.Structure):
    """`TransitionTable` of core/transitions.hpp.  Who makes one keeps the arrays alive."""

    _fields_ = (
        *((name, ADDRESS) for name in ("probability", "outcome", "used")),
        *((name, INTEGER) for name in ("states", "actions", "bins")),
    )


class TransitionTable:
    """A `Table` that keeps its arrays alive: probabilities and outcomes (S, A, B), C-contiguous.

    `used` (S, A): how many bins of each state-action may have a probability, the first ones; None: all may.
    """

    def __init__(self, probabilities: Array, outcomes: Ints, used: Ints | None = None) -> None:
        self._arrays = probabilities, outcomes, used
        at = None if used is None else address(used)
        self._table = Table(address(probabilities), address(outcomes), at, *outcomes.shape)
        self.at = addressof(self._table)
        self.rows = outcomes.shape[:2]


solve: Callable[[int, int, int, int, float, float, bool, bool], int] = function(
    "value_iteration", ADDRESS, ADDRESS, ADDRESS, ADDRESS, REAL, REAL, INTEGER, INTEGER, result=INTEGER
)
"""Sweep until no value changes by the tolerance; returns the number of sweeps over all actions, or what is wrong.

Of the addresses of a table, a reward (S, A), values (S,), which change in place, and action values (S, A), which are filled; the
discount and the tolerance; whether this is in units of the largest reward, and whether it is modified policy iteration.
"""

__all__ = ["BAD_OUTCOME", "BAD_REWARD", "BAD_START", "Table", "TransitionTable", "addressof", "solve"]
