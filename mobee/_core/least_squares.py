# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics by least squares from many starts; declares core/least_squares.cpp."""

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
    """Move the free motors of every start pose so that it satisfies the aims, by least squares; `q` (B, n) rad changes in place.

    Return the number of poses that were evaluated, and the residuals (B, K) of the K aims. `robot`: its handle. `aims` (K, 4): rows `Aim`
    of core/aims.hpp (kind, first link, second link, motor). `goals`: `Goal`s of all aims (core/aims.hpp), in one row for all starts or in
    one row for each start. `free` (d,): indices of the free motors. `limits`: their lowest and highest positions, each (d,) rad. `steps`:
    largest number of steps for a start.
    """
    residuals = np.empty((len(q), len(aims)))
    low, high = limits
    arrays = (address(array) for array in (aims, goals, free, low, high, q, residuals))
    search = _Search(robot.at, *arrays, len(aims), len(free), len(q), len(goals) == 1, steps, threads)
    looked: int = _descend(ctypes.addressof(search))
    return looked, residuals
