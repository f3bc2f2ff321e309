# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics by least squares from many starts, computed by core/least_squares.cpp."""

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
    """Move the free motors of every start pose, by least squares, until it satisfies the aims; `q` (B, n) rad changes in place.

    An aim is a condition on the pose: for example, a point of a link shall be at a given place. Returns the number of poses that were
    evaluated, and the remaining errors (B, K) of the K aims [m or rad]. `robot`: handle of the robot in the core. `aims` (K, 4): kind,
    first link, second link and motor of each aim (`Aim` in core/aims.hpp). `goals`: the goals of all aims (`Goal` in core/aims.hpp), in one
    row for all starts or in one row for each start. `free` (d,): indices of the free motors. `limits`: the lowest and the highest positions
    of the free motors, each (d,) rad. `steps`: largest number of steps for a start. `threads`: number of threads.
    """
    residuals = np.empty((len(q), len(aims)))
    low, high = limits
    arrays = (address(array) for array in (aims, goals, free, low, high, q, residuals))
    search = _Search(robot.at, *arrays, len(aims), len(free), len(q), len(goals) == 1, steps, threads)
    looked: int = _descend(ctypes.addressof(search))
    return looked, residuals
