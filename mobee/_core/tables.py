# SPDX-License-Identifier: Apache-2.0
"""Passes arrays to the core, as address and length, or as one column for each member of a structure."""

from __future__ import annotations

import ctypes

import numpy as np

from mobee._core import ADDRESS, INTEGER, address
from mobee.arrays import Array, Ints

Table = np.ndarray[tuple[int, ...], np.dtype[np.void]]
"""An array of structures of the core: `table["low"]` is a view of one member of all of them."""

WHOLE = "i8"

NUMBERS, REALS = 6, 7  # of a contact: pose, kind, first, second, their links; depth, normal, point
ROW_BYTES = 8 * (NUMBERS + REALS)


class View(ctypes.Structure):
    """An array whose owner is elsewhere."""

    _fields_ = (("data", ADDRESS), ("size", INTEGER))


def view(array: Array | Ints | Table) -> View:
    """Return a C-contiguous array, which the caller keeps alive, as the core reads it."""
    return View(address(array), len(array))


def columns(*names: str, whole: tuple[str, ...] = ()) -> np.dtype[np.void]:
    """Return the type of a structure of these real numbers, followed by these whole numbers."""
    return np.dtype([*((name, "f8") for name in names), *((name, WHOLE) for name in whole)])


INTERVAL = np.dtype([("first", WHOLE), ("end", WHOLE)])


def numbers(values: Array, count: int) -> bytes:
    """Return `count` numbers as bytes, for a function of the core that does not change them; raises ValueError for another shape."""
    given = np.asarray(values, dtype=np.float64)
    if given.shape != (count,):
        raise ValueError(f"an array of shape {given.shape}: must be ({count},)")
    return given.tobytes()
