"""A last search around a way out of curved volumes that the expanding polytope could not end, because many are nearly as short."""

from __future__ import annotations

import math

from mobee.engine.compiled import inner
from mobee.engine.narrow.difference import farthest
from mobee.engine.narrow.slots import ONE, SIX, THREE, TIE, TWO, ZERO, Offset, Vector
from mobee.robot.robot import Array

_RING = 64  # directions tried all round the axis of either
_ROUNDS = 100
_GAIN = 1e-13  # m: more than rounding
_FINEST = 1e-8  # rad; the reach is then within its square of a smooth minimum


@inner
def polish(P: Array, i: Offset, j: Offset, V: Array, frame: Array, shortest: float, way: Vector) -> tuple[float, Vector]:
    """A direction near `way`, or square to the axis of either volume, along which the difference b - a reaches least.

    With that reach [m], which comes first, in the first's axes.  The search turns about the axes of both volumes: where a least
    reach of cylinders or boxes is a crease, it is square to one of them.
    """
    nx, ny, nz = way
    for which in range(_RING + _RING):
        angle = 2.0 * math.pi * which / _RING
        x, y, z = math.cos(angle), math.sin(angle), 0.0
        if which >= _RING:
            x, y, z = frame[3] * x + frame[4] * y, frame[6] * x + frame[7] * y, frame[9] * x + frame[10] * y
        p = farthest(P, i, j, V, frame, x, y, z)
        reach = x * p[0] + y * p[1] + z * p[2]
        if reach < shortest - TIE:
            shortest, nx, ny, nz = reach, x, y, z
    step = 0.1
    for _ in range(_ROUNDS):
        before = shortest
        for which in range(SIX + SIX):
            axis = which // TWO
            if axis < THREE:
                kx, ky, kz = (1.0 if axis == ZERO else 0.0), (1.0 if axis == ONE else 0.0), (1.0 if axis == TWO else 0.0)
            else:
                kx, ky, kz = frame[axis], frame[axis + THREE], frame[axis + SIX]
            sine, cosine = math.sin(step) * (1.0 if which % TWO == ZERO else -1.0), math.cos(step)
            along = (kx * nx + ky * ny + kz * nz) * (1.0 - cosine)
            x = nx * cosine + (ky * nz - kz * ny) * sine + kx * along
            y = ny * cosine + (kz * nx - kx * nz) * sine + ky * along
            z = nz * cosine + (kx * ny - ky * nx) * sine + kz * along
            length = math.sqrt(x * x + y * y + z * z)
            x, y, z = x / length, y / length, z / length
            p = farthest(P, i, j, V, frame, x, y, z)
            reach = x * p[0] + y * p[1] + z * p[2]
            if reach < shortest - _GAIN:
                shortest, nx, ny, nz = reach, x, y, z
        if shortest == before:
            step *= 0.5
            if step < _FINEST:
                break
    return shortest, (nx, ny, nz)
