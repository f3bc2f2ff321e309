"""The Minkowski difference b - a of two cores (volumes without their rounding), seen from the first: its support function.

Moving a along n by the largest n.d over all d of the difference puts a plane between the two.
"""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inner
from mobee.engine.narrow.features import BOX, CAPSULE, CYLINDER, SPHERE
from mobee.engine.narrow.slots import HALF, KIND, RADIUS, Offset, Vector, centers_apart, into, own_axis, vector
from mobee.robot.robot import Array

FRAME = 12  # numbers: where the second is, seen from the first (3), and how it is turned (9, row-major)


@inner
def relative(P: Array, i: Offset, j: Offset, frame: Array) -> None:
    """Write where the second volume is, seen from the first."""
    x, y, z = centers_apart(P, j, i)
    frame[0], frame[1], frame[2] = into(P, i, x, y, z)
    for column in range(3):
        x, y, z = own_axis(P, j, np.uint64(column))
        frame[3 + column], frame[6 + column], frame[9 + column] = into(P, i, x, y, z)


@inner
def rounding(P: Array, i: Offset) -> float:
    """By how much a volume is larger than its core [m]."""
    return P[i + RADIUS] if P[i + KIND] <= CAPSULE else 0.0


@inner
def farthest(P: Array, i: Offset, j: Offset, V: Array, frame: Array, x: float, y: float, z: float) -> Vector:
    """The point of the difference that is farthest along (x, y, z), in the first's axes."""
    ax, ay, az = _support(P, i, V, -x, -y, -z)
    bx, by, bz = _support(
        P,
        j,
        V,
        frame[3] * x + frame[6] * y + frame[9] * z,
        frame[4] * x + frame[7] * y + frame[10] * z,
        frame[5] * x + frame[8] * y + frame[11] * z,
    )
    return (
        frame[0] + frame[3] * bx + frame[4] * by + frame[5] * bz - ax,
        frame[1] + frame[6] * bx + frame[7] * by + frame[8] * bz - ay,
        frame[2] + frame[9] * bx + frame[10] * by + frame[11] * bz - az,
    )


@inner
def _support(P: Array, i: Offset, V: Array, x: float, y: float, z: float) -> Vector:
    """The point of a core that is farthest along (x, y, z), both in its own axes."""
    kind = P[i + KIND]
    if kind == SPHERE:
        return 0.0, 0.0, 0.0
    hx, hy, hz = vector(P, i + HALF)
    if kind == BOX:
        return math.copysign(hx, x), math.copysign(hy, y), math.copysign(hz, z)
    if kind == CAPSULE:
        return 0.0, 0.0, math.copysign(hy, z)
    if kind == CYLINDER:
        side = math.sqrt(x * x + y * y)
        if side == 0.0:
            return hx, 0.0, math.copysign(hy, z)
        return hx * x / side, hx * y / side, math.copysign(hy, z)
    first, best, most = np.uint64(hx), np.uint64(hx), -math.inf
    for k in range(np.uint64(hy)):
        px, py, pz = vector(V, (first + k) * np.uint64(3))
        along = x * px + y * py + z * pz
        if along > most:
            best, most = first + k, along
    return vector(V, best * np.uint64(3))
