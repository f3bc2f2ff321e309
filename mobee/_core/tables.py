# SPDX-License-Identifier: Apache-2.0
"""Types for passing arrays to the native core: an address with a length, and tables of C structures."""

from __future__ import annotations

import ctypes

import numpy as np

from mobee._core import ADDRESS, INTEGER, address
from mobee.arrays import Array, Ints

Table = np.ndarray[tuple[int, ...], np.dtype[np.void]]
"""An array of structures of the core: `table["low"]` is a view of the member `low` of all structures."""

WHOLE = "i8"

NUMBERS, REALS = 6, 7  # of a contact: pose, kind, first, second, their links; depth, normal, point
ROW_BYTES = 8 * (NUMBERS + REALS)


class View(ctypes.Structure):
    """The address and the length of an array, as an argument of the core; the caller keeps the array alive."""

    _fields_ = (("data", ADDRESS), ("size", INTEGER))


def view(array: Array | Ints | Table) -> View:
    """Return the address and the length of a C-contiguous array; the caller must keep the array alive while the core uses it."""
    return View(address(array), len(array))


def columns(*names: str, whole: tuple[str, ...] = ()) -> np.dtype[np.void]:
    """Return the NumPy type of a structure of the core: a double for each of `names`, then a 64-bit integer for each of `whole`."""
    return np.dtype([*((name, "f8") for name in names), *((name, WHOLE) for name in whole)])


INTERVAL = np.dtype([("first", WHOLE), ("end", WHOLE)])


def numbers(values: Array, count: int) -> bytes:
    """Return the numbers `values` (count,) as bytes, for a function of the core that only reads them; ValueError for another shape."""
    given = np.asarray(values, dtype=np.float64)
    if given.shape != (count,):
        raise ValueError(f"an array of shape {given.shape}: must be ({count},)")
    return given.tobytes()
