"""Plans over tables of outcomes: the function of core/value_iteration.cpp."""

from __future__ import annotations

import ctypes
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
        self.shape = outcomes.shape
        self.at = ctypes.addressof(self)
        self._kept: Any = probabilities, outcomes, used


_solve = function("value_iteration", ADDRESS, ADDRESS, ADDRESS, ADDRESS, REAL, REAL, INTEGER, INTEGER, result=INTEGER)


def solve(
    table: TransitionTable, reward: Array, values: Array, found: Array, discount: float, tolerance: float, relative: bool, evaluate: bool
) -> int:
    """Sweep until no value changes by the tolerance; `values` (S,) change in place, `found` (S, A) is filled.

    `reward`: (S, A).  `relative`: the tolerance is in units of the largest reward; `evaluate`: modified policy iteration.  Returns the
    number of sweeps over all actions, or what is wrong.
    """
    sweeps: int = _solve(table.at, address(reward), address(values), address(found), discount, tolerance, relative, evaluate)
    return sweeps
