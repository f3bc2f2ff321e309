"""Vectors of costs: checked ones, their lengths and directions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mobee.errors import InvalidValue
from mobee.real_array import real_array
from mobee.robot.robot import Array


def vector(name: str, given: ArrayLike) -> Array:
    """A copy of what was given, (3,); raises InvalidValue if it is not three finite numbers."""
    found = real_array(name, given)
    if found.shape != (3,) or not np.isfinite(found).all():
        raise InvalidValue(f"{name} is {given!r}; it must be (3,) finite numbers.")
    return found


def unit_vector(name: str, given: ArrayLike) -> Array:
    """The direction (3,) of what was given; raises InvalidValue if it has none."""
    found = vector(name, given)
    if not np.linalg.norm(found) > 0.0:
        raise InvalidValue(f"{name} is {given!r}; it must be a direction (3,), or a rotation (3, 3).")
    return units(found)


def lengths(vectors: Array) -> Array:
    """Of vectors (..., d), (...,)."""
    found: Array = np.sqrt((vectors**2).sum(axis=-1))
    return found


def units(vectors: Array) -> Array:
    """Vectors (..., d) at length 1; those of no length stay so."""
    found: Array = vectors / np.maximum(lengths(vectors)[..., None], 1e-12)
    return found


def angle_between(one: Array, other: Array) -> Array:
    """The angle between unit vectors (..., 3), (...,) rad; exact near 0 and near pi too."""
    angle: Array = 2.0 * np.arctan2(lengths(one - other), lengths(one + other))
    return angle


def rotation(name: str, given: ArrayLike) -> Array:
    """A copy of what was given, (3, 3); raises InvalidValue if it is no rotation."""
    found = real_array(name, given)
    if found.shape != (3, 3) or not np.allclose(found @ found.T, np.eye(3), atol=1e-6) or np.linalg.det(found) < 0.0:
        raise InvalidValue(f"{name} is no rotation: its rows must be a right-handed set of three unit vectors.")
    return found


def turn_between(one: Array, other: Array) -> Array:
    """The angle of the turn from rotations (..., 3, 3) to others, (...,) rad."""
    apart = np.sqrt(((one - other) ** 2).sum(axis=(-2, -1)) / 8.0)  # sin(angle / 2)
    angle: Array = 2.0 * np.arcsin(np.minimum(apart, 1.0))
    return angle
