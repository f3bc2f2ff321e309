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
