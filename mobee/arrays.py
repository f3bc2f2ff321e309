"""Array types, and the check of arrays that a caller gives."""

from __future__ import annotations

import reprlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mobee.errors import InvalidValue

Array = NDArray[np.float64]
Ints = NDArray[np.intp]


def real_array(what: str, given: ArrayLike) -> Array:
    """A copy, row by row in memory; raises InvalidValue for what is no array of numbers, and for text and complex numbers.

    NumPy would convert these, too: read the text, and drop imaginary parts.
    """
    try:
        value = np.array(given, order="C")
        if value.dtype.kind in "SU":
            raise ValueError  # NumPy would read their digits
        if value.dtype.kind != "c":
            return value if value.dtype == np.float64 else value.astype(np.float64)
    except (TypeError, ValueError):
        raise InvalidValue(f"{what} is {' '.join(reprlib.repr(given).split())}; it must be an array of numbers.") from None
    raise InvalidValue(f"{what} is complex, {value.ravel()[:1].tolist()} first; it must be real numbers.")
