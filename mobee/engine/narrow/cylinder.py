"""A sphere with a true cylinder."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inner
from mobee.engine.narrow.slots import CENTER, HALF, ONE, RADIUS, TIE, TOUCHING, centers_apart, into, out_of, sign, store, vector
from mobee.robot.robot import Array


@inner
def sphere_cylinder(P: Array, a: int, b: int, out: Array) -> float:
    """See `overlap`."""
    i, j = np.uint64(a), np.uint64(b)
    x, y, z = centers_apart(P, i, j)
    x, y, z = into(P, j, x, y, z)
    side, radius = math.sqrt(x * x + y * y), P[i + RADIUS]
    across, along = side - P[j + HALF], abs(z) - P[j + HALF + ONE]
    dx, dz = max(across, 0.0), max(along, 0.0)
    distance = math.sqrt(dx * dx + dz * dz)
    if distance >= radius:
        return radius - distance
    if side > TOUCHING:
        nx, ny = x / side, y / side
    else:
        nx, ny = 1.0, 0.0
    nz = sign(z)
    if distance > TOUCHING:
        nx, ny, nz = nx * (dx / distance), ny * (dx / distance), nz * (dz / distance)
        apart = distance
    elif across > along + TIE:
        nz, apart = 0.0, across
    else:
        nx, ny, apart = 0.0, 0.0, nz * z - P[j + HALF + ONE]
    back = (radius + apart) / 2.0
    bx, by, bz = vector(P, j + CENTER)
    px, py, pz = out_of(P, j, x - back * nx, y - back * ny, z - back * nz)
    store(out, out_of(P, j, nx, ny, nz), (px + bx, py + by, pz + bz))
    return radius - apart
