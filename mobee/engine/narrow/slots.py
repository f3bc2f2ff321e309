"""Reading a slot of a pose.  Offsets are unsigned, which spares every access the test for an index from the end."""

from __future__ import annotations

import numpy as np

from mobee.engine import layout
from mobee.engine.compiled import inner
from mobee.robot.robot import Array

Offset = np.uint64
Vector = tuple[float, float, float]

# As globals, numbers keep their type; a literal would have a function compiled once more for each of its values.
ZERO, ONE, TWO, THREE, FOUR, SIX = np.uint64(0), np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4), np.uint64(6)
CENTER, ROTATION, HALF = np.uint64(layout.CENTER), np.uint64(layout.ROTATION), np.uint64(layout.HALF)
CORE, RADIUS, KIND = np.uint64(layout.CORE), np.uint64(layout.RADIUS), np.uint64(layout.KIND)

TOUCHING = 1e-10  # m: below it a distance is no direction
TIE = 1e-9  # m: a way out must be shorter by more than this to be preferred to an earlier one
FLAT = 1e-9  # sine of the angle below which a line counts as parallel to a face


@inner
def vector(P: Array, at: Offset) -> Vector:
    """The three numbers from `at` on."""
    return P[at], P[at + ONE], P[at + TWO]


@inner
def centers_apart(P: Array, a: Offset, b: Offset) -> Vector:
    """From the centre of b to that of a, root frame."""
    i, j = a + CENTER, b + CENTER
    return P[i] - P[j], P[i + ONE] - P[j + ONE], P[i + TWO] - P[j + TWO]


@inner
def into(P: Array, a: Offset, x: float, y: float, z: float) -> Vector:
    """A vector of the root frame, in a's own axes."""
    i = a + ROTATION
    j, k = i + THREE, i + SIX
    return (
        P[i] * x + P[j] * y + P[k] * z,
        P[i + ONE] * x + P[j + ONE] * y + P[k + ONE] * z,
        P[i + TWO] * x + P[j + TWO] * y + P[k + TWO] * z,
    )


@inner
def out_of(P: Array, a: Offset, x: float, y: float, z: float) -> Vector:
    """A vector in a's own axes, in the root frame."""
    i = a + ROTATION
    j, k = i + THREE, i + SIX
    return (
        P[i] * x + P[i + ONE] * y + P[i + TWO] * z,
        P[j] * x + P[j + ONE] * y + P[j + TWO] * z,
        P[k] * x + P[k + ONE] * y + P[k + TWO] * z,
    )


@inner
def own_axis(P: Array, a: Offset, column: Offset) -> Vector:
    """One of a's own axes, root frame."""
    i = a + ROTATION + column
    return P[i], P[i + THREE], P[i + SIX]


@inner
def unit(value: float) -> float:
    """Clipped to [-1, 1]."""
    return min(max(value, -1.0), 1.0)


@inner
def sign(value: float) -> float:
    """-1 or 1; next to zero always 1, so that rounding cannot choose."""
    return -1.0 if value < -TIE else 1.0


@inner
def store(out: Array, normal: Vector, point: Vector) -> None:
    """Write a contact."""
    out[0], out[1], out[2] = normal
    out[3], out[4], out[5] = point
