# SPDX-License-Identifier: Apache-2.0
"""Types for passing arrays to the native core: an address with a length, and tables of C structures."""

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
    """Address and length of an array; the caller keeps the array alive."""

    _fields_ = (("data", ADDRESS), ("size", INTEGER))


def view(array: Array | Ints | Table) -> View:
    """Return address and length of a C-contiguous array; the caller keeps the array alive."""
    return View(address(array), len(array))


def columns(*names: str, whole: tuple[str, ...] = ()) -> np.dtype[np.void]:
    """Return the dtype of a structure: a double for each of `names`, then a 64-bit integer for each of `whole`."""
    return np.dtype([*((name, "f8") for name in names), *((name, WHOLE) for name in whole)])


INTERVAL = np.dtype([("first", WHOLE), ("end", WHOLE)])


def numbers(values: Array, count: int) -> bytes:
    """Return `count` numbers as bytes, for a function of the core that does not change them; raises ValueError for another shape."""
    given = np.asarray(values, dtype=np.float64)
    if given.shape != (count,):
        raise ValueError(f"an array of shape {given.shape}: must be ({count},)")
    return given.tobytes()
