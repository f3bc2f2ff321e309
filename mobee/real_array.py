"""Numbers that a caller gives, as an array of 64-bit floats."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mobee.errors import InvalidValue
from mobee.robot.robot import Array


def real_array(what: str, given: ArrayLike) -> Array:
    """A copy, row by row in memory; raises InvalidValue for what is no array of numbers, and for complex numbers.

    NumPy would convert these, too, and drop their imaginary parts.
    """
    try:
        value = np.array(given, order="C")
        if value.dtype.kind != "c":
            return value if value.dtype == np.float64 else value.astype(np.float64)
    except (TypeError, ValueError):
        raise InvalidValue(f"{what} is {given!r}; it must be an array of numbers.") from None
    raise InvalidValue(f"{what} is complex, {value.ravel()[:1].tolist()} first; it must be real numbers.")
