# SPDX-License-Identifier: Apache-2.0
"""Least squares from many starts; declares core/least_squares.cpp."""

from __future__ import annotations

import ctypes

import numpy as np
from numpy.typing import NDArray

from mobee._core import ADDRESS, INTEGER, address, function
from mobee._core.engine import Handle

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class _Search(ctypes.Structure):
    """`Search` of core/least_squares.cpp."""

    _fields_ = (
        *((name, ADDRESS) for name in ("robot", "aims", "goals", "free", "low", "high", "q", "residuals")),
        *((name, INTEGER) for name in ("count", "frees", "starts", "one_goal", "steps", "threads")),
    )


_descend = function("descend", ADDRESS, result=INTEGER)


def descend(
    robot: Handle, aims: Ints, goals: Array, free: Ints, limits: tuple[Array, Array], steps: int, q: Array, threads: int
) -> tuple[int, Array]:
    """Move the free motors (d,) of every start q (B, n), in place, towards the aims; return the poses evaluated and residuals (B, K).

    `aims` (K, 4): `Aim` of core/aims.hpp. `goals`: `Goal`s of all aims, in one row for all starts, or one row for each. `limits`: the
    lowest and the highest positions (d,) rad. `steps`: maximum number for one start.
    """
    residuals = np.empty((len(q), len(aims)))
    low, high = limits
    arrays = (address(array) for array in (aims, goals, free, low, high, q, residuals))
    search = _Search(robot.at, *arrays, len(aims), len(free), len(q), len(goals) == 1, steps, threads)
    looked: int = _descend(ctypes.addressof(search))
    return looked, residuals
