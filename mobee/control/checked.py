"""Checks inputs of the control law: finite numbers, one for each motor, no overflow."""

from __future__ import annotations

import math

import numpy as np

from mobee.arrays import Array, real_array
from mobee.errors import InvalidValue

_FLOAT = np.dtype(np.float64)
LARGEST_FORCE = 1e9  # rad/s^2, or N/kg at a marker: far more than any squash lets through, far less than overflows in it


def checked(what: str, value: Array, length: int) -> Array:
    """A copy of what must be that many finite numbers; raises InvalidValue."""
    # The first of all tests is for what is usually given: what comes after it takes several times as long.
    if type(value) is np.ndarray and value.dtype is _FLOAT and value.shape == (length,) and all(map(math.isfinite, value.tolist())):
        return value.copy()
    array = real_array(what, value)
    if array.shape != (length,):
        raise InvalidValue(f"{what} of shape {array.shape}: must be {length} finite numbers")
    if not np.isfinite(array).all():
        worst = int(np.argmax(np.nan_to_num(np.abs(array), nan=np.inf)))
        raise InvalidValue(f"{what}: number {worst} is {array[worst]}; must be {length} finite numbers")
    return array


def checked_force(what: str, value: Array, length: int) -> Array:
    """A copy of what must be that many numbers of at most LARGEST_FORCE; raises InvalidValue."""
    array = checked(what, value, length)
    if np.abs(array).max(initial=0.0) > LARGEST_FORCE:
        raise InvalidValue(f"{what}: {array[np.abs(array).argmax()]:.3g}; must be at most {LARGEST_FORCE:g} in size")
    return array
