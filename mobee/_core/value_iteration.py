"""Plans over tables of outcomes: the function of core/value_iteration.cpp."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee._core import ADDRESS, INTEGER, REAL, address, function

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

BAD_REWARD, BAD_OUTCOME, BAD_START = -1, -2, -3  # instead of the number of sweeps


class TransitionTable(ctypes.Structure):
    """`TransitionTable` of core/transitions.hpp; keeps the arrays alive that it points to.

    `probabilities` and `outcomes`: (S, A, B).  `used` (S, A): how many bins of each state-action may have a probability, the first
    ones; None: all may.  All are C-contiguous.
    """

    _fields_ = (
        *((name, ADDRESS) for name in ("_probability", "_outcome", "_used")),
        *((name, INTEGER) for name in ("states", "actions", "bins")),
    )

    def __init__(self, probabilities: Array, outcomes: Ints, used: Ints | None = None) -> None:
        super().__init__(address(probabilities), address(outcomes), None if used is None else address(used), *outcomes.shape)
        self.rows = outcomes.shape[:2]
        self.at = ctypes.addressof(self)
        self._kept: Any = probabilities, outcomes, used


solve: Callable[[int, int, int, int, float, float, bool, bool], int] = function(
    "value_iteration", ADDRESS, ADDRESS, ADDRESS, ADDRESS, REAL, REAL, INTEGER, INTEGER, result=INTEGER
)
"""Sweep until no value changes by the tolerance; returns the number of sweeps over all actions, or what is wrong.

Of the addresses of a table, a reward (S, A), values (S,), which change in place, and action values (S, A), which are filled; the
discount and the tolerance; whether this is in units of the largest reward, and whether it is modified policy iteration.
"""
