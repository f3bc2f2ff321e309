# SPDX-License-Identifier: Apache-2.0
"""Checks of straight motions for contacts, and inverse kinematics; declares core/edges.cpp and core/least_squares.cpp."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mobee._core import ADDRESS, INTEGER, address, function
from mobee._core.engine import Handle

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class _Motions(ctypes.Structure):
    """`Motions` of core/edges.cpp."""

    _fields_ = (
        *((name, ADDRESS) for name in ("near", "q", "edges", "between", "free")),
        *((name, INTEGER) for name in ("count", "motors", "threads")),
    )


_sweep = function("sweep", ADDRESS, result=INTEGER)


def sweep(near: Sequence[int], q: Array, edges: Ints, between: Ints) -> tuple[NDArray[np.bool_], int]:
    """Check straight motions between poses for contacts; return which motions are free (E,), and the number of poses checked.

    `near`: addresses of neighbour lists (lists of pairs of volumes that are near each other, `mobee._core.engine.Following.at`), one for
    each thread, all for the same robot and world; the caller keeps the lists alive. `q`: (V, n) rad, the poses. `edges`: (E, 2), the
    indices in `q` of the two ends of each motion. `between` (E,): number of poses to check between the ends; the ends themselves are not
    checked. Contacts of fields (volumes that cause repulsive forces) count too, if the robot has fields.
    """
    free = np.empty(len(edges), dtype=np.bool_)
    users = (ADDRESS * len(near))(*near)
    arrays = (address(array) for array in (q, edges, between, free))
    motions = _Motions(ctypes.addressof(users), *arrays, len(edges), q.shape[1], len(near))
    looked: int = _sweep(ctypes.addressof(motions))
    return free, looked


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
    evaluated, and the remaining errors (B, K) of the K aims [m or rad].

    `robot`: handle of the robot in the core. `aims` (K, 4): kind, first link, second link and motor of each aim (`Aim` in core/aims.hpp).
    `goals` (1, 26 K), the same goals for all starts, or (B, 26 K), own goals for each start; a goal has 26 numbers (`Goal` in
    core/aims.hpp). `free` (d,): indices of the free motors. `limits`: the lowest and the highest positions of the free motors, each (d,)
    rad. `steps`: largest number of steps for a start. `threads`: number of threads.
    """
    residuals = np.empty((len(q), len(aims)))
    low, high = limits
    arrays = (address(array) for array in (aims, goals, free, low, high, q, residuals))
    search = _Search(robot.at, *arrays, len(aims), len(free), len(q), len(goals) == 1, steps, threads)
    looked: int = _descend(ctypes.addressof(search))
    return looked, residuals
