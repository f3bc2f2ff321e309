"""Sums over past values weighted by distance; declares core/histories.cpp."""

from __future__ import annotations

import ctypes

import numpy as np
from numpy.typing import NDArray

from mobee._core import ADDRESS, INTEGER, REAL, address, function

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class _History(ctypes.Structure):
    """`History` of core/histories.cpp."""

    _fields_ = (
        *((name, ADDRESS) for name in ("targets", "keys", "sums")),
        *((name, INTEGER) for name in ("known", "used")),
        *((name, REAL) for name in ("scale", "near")),
    )


_weighted_sums = function("weighted_sums", ADDRESS, ADDRESS, ADDRESS, ADDRESS)
_gaussian_sums = function("gaussian_sums", ADDRESS, INTEGER, INTEGER, ADDRESS, INTEGER, ADDRESS)


def weighted_sums(
    targets: Array, keys: Ints, sums: Array, sizes: tuple[int, int], weighing: tuple[float, float], target: Array, out: Array
) -> None:
    """Add to `out` (2, actions) what each action brought on targets near this one (3,) m, and how much that counts.

    `targets` (..., 3) m, `keys` (..., 2): action and number of the target of each entry, `sums` (..., 2): sum and number of its values;
    `sizes`: how many targets and entries there are.  `weighing`: a scale and a distance [m]: the weight of a target at a distance d is
    1 / (1 + d / scale), none beyond that distance.
    """
    history = _History(address(targets), address(keys), address(sums), *sizes, *weighing)
    totals = address(out)
    _weighted_sums(ctypes.addressof(history), address(target), totals, totals + out[0].nbytes)


def gaussian_sums(asked: Array, events: Array, sums: Array) -> None:
    """Add to `sums` (2, n), at each point asked about (n, d), the weights times values of events, and the weights.

    Events are rows of a point and a value, (..., d + 1).  The weight at a distance r is exp(-r^2 / 2).
    """
    _gaussian_sums(address(asked), *asked.shape, address(events), len(events), address(sums))
