"""Checks straight motions between poses; declares core/edges.cpp."""

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
    """Whether nothing touches between the poses q (V, n) of each edge (E, 2), (E,), and how many poses were looked at.

    `near`: the addresses of what is remembered, see `Following`, one for each thread, all in one world; the caller keeps them alive.
    `between` (E,): how many poses there are between the ends, which themselves are not looked at.
    """
    free = np.empty(len(edges), dtype=np.bool_)
    users = (ADDRESS * len(near))(*near)
    arrays = (address(array) for array in (q, edges, between, free))
    motions = _Motions(ctypes.addressof(users), *arrays, len(edges), q.shape[1], len(near))
    looked: int = _sweep(ctypes.addressof(motions))
    return free, looked
