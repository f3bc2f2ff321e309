# SPDX-License-Identifier: Apache-2.0
"""Checks straight motions between poses for contacts; declares core/edges.cpp."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mobee._core import ADDRESS, INTEGER, address, function

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
    """Return for each edge, a straight motion between two poses, whether it is free of contacts, (E,), and how many poses were checked.

    `near`: addresses of neighbour lists (`mobee._core.engine.Following.at`), one for each thread, all in the same world; the caller keeps
    the lists alive. `q`: (V, n) rad, poses. `edges`: (E, 2) indices of poses. `between` (E,): number of poses to check between the two
    ends, which are not checked.
    """
    free = np.empty(len(edges), dtype=np.bool_)
    users = (ADDRESS * len(near))(*near)
    arrays = (address(array) for array in (q, edges, between, free))
    motions = _Motions(ctypes.addressof(users), *arrays, len(edges), q.shape[1], len(near))
    looked: int = _sweep(ctypes.addressof(motions))
    return free, looked
