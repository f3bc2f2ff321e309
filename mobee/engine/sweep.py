"""Whether straight motions from pose to pose touch anything: the middle of each first, and no pose more after the first that touches."""

from __future__ import annotations

import numpy as np

from mobee.engine.compiled import entry
from mobee.engine.memory import memory_of
from mobee.engine.neighbours import Around, find
from mobee.engine.pack import Flags, UInts
from mobee.robot.robot import Array, Ints


@entry(
    "int64("
    "uint64[::1], float64[::1], float64[::1], float64[::1], uint64[::1], float64[::1], float64[::1], int64[::1], int64, int64, "
    "float64, boolean, uint64[::1], float64[::1], float64[::1], uint64[::1], int64[::1], boolean[::1], "
    "float64[:,::1], int64[:,::1], int64[::1], boolean[::1])"
)
def sweep(
    integers: UInts,
    floats: Array,
    wide: Array,
    vertices: Array,
    world: UInts,
    places: Array,
    wide_places: Array,
    carried: Ints,
    own_shapes: int,
    reaching: int,
    skin: float,
    cut: bool,
    common: UInts,
    slots: Array,
    reals_memory: Array,
    pairs_memory: UInts,
    ints: Ints,
    flags: Flags,
    q: Array,
    edges: Ints,
    poses: Ints,
    free: Flags,
) -> int:
    """Fill `free` (E,): whether nothing touches between the poses q (V, n) of each edge (E, 2); returns how many poses were looked at.

    `poses` (E,): how many between the ends, which themselves are not looked at.  The others: as of `neighbours.follow`.
    """
    here = Around(integers, floats, wide, vertices, world, places, wide_places, carried, own_shapes, reaching, skin, cut, common, slots)
    m = memory_of(integers, world, reals_memory, pairs_memory, ints, flags)
    most, looked = 1, 0
    for e in range(len(edges)):
        most = max(most, poses[e])
    low, high, between = np.empty(most, dtype=np.int64), np.empty(most, dtype=np.int64), np.empty(q.shape[1])
    for e in range(len(edges)):
        a, b, share = edges[e, 0], edges[e, 1], 1.0 / (poses[e] + 1.0)
        low[0], high[0] = 1, poses[e]
        done, known, free[e] = 0, 1 if poses[e] > 0 else 0, True
        while done < known:  # stretches of poses of which none was looked at, the long ones first
            first, last = low[done], high[done]
            middle = (first + last) // 2
            done += 1
            for k in range(len(between)):
                between[k] = q[a, k] + (q[b, k] - q[a, k]) * (share * middle)
            looked += 1
            if find(here, between, m) > np.uint64(0):
                free[e] = False
                break
            if first < middle:
                low[known], high[known] = first, middle - 1
                known += 1
            if middle < last:
                low[known], high[known] = middle + 1, last
                known += 1
    return looked
