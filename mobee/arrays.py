# SPDX-License-Identifier: Apache-2.0
"""Array types, and checks of arguments: arrays, numbers, counts, and numbers of threads."""

from __future__ import annotations

import reprlib
from numbers import Real
from typing import TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mobee.errors import InvalidValue

Array = NDArray[np.float64]
Ints = NDArray[np.intp]

MAX_THREADS = 1024


def real_array(what: str, given: ArrayLike) -> Array:
    """Return a C-contiguous float64 copy of the given numbers; raises InvalidValue unless all are real numbers.

    `what`: name of the array in the error message. Text, dates and complex numbers are refused too: NumPy would convert the first two to
    numbers and drop the imaginary parts.
    """
    try:
        value = np.array(given, order="C")
        if value.dtype.kind not in "biufcO" or value.dtype.kind == "O" and not all(isinstance(one, Real) for one in value.flat):
            raise ValueError
        if value.dtype.kind != "c":
            return value if value.dtype == np.float64 else value.astype(np.float64)
    except (TypeError, ValueError):
        raise InvalidValue(f"{what} is {' '.join(reprlib.repr(given).split())}; it must be an array of numbers.") from None
    raise InvalidValue(f"{what} is complex, {value.ravel()[:1].tolist()} first; it must be real numbers.")


def checked_seed(seed: int) -> int:
    """Return the given seed as an int; raises InvalidValue unless it is a whole number of at least 0."""
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        raise InvalidValue(f"seed {seed!r}: must be a whole number, 0 or more")
    return int(seed)


def is_number(value: object) -> TypeGuard[float]:
    """Return whether a value is a real number, such as an int, a float, a Fraction or a scalar of NumPy; NaN and infinity are too."""
    return isinstance(value, Real)


def checked_count(what: str, count: int, least: int = 0) -> int:
    """Return the given count as an int; raises InvalidValue, with the name `what`, unless it is a whole number of at least `least`."""
    if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < least:
        raise InvalidValue(f"{what}={count!r}: give a whole number, {least} or more.")
    return int(count)


def checked_threads(threads: int) -> int:
    """Return the given number of threads as an int; raises InvalidValue if it is not a whole number from 1 to MAX_THREADS (1024)."""
    if isinstance(threads, bool) or not isinstance(threads, int | np.integer) or not 1 <= threads <= MAX_THREADS:
        raise InvalidValue(f"threads={threads!r}: give a whole number from 1 to {MAX_THREADS}.")
    return int(threads)
