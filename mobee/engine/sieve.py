"""Drops most pairs whose enclosing spheres overlap though the volumes do not.

Everything here is scalars in one loop: handing arrays to a function costs more than this arithmetic.  A pair is only dropped when a
separating direction or the exact distance says so by a margin; what is left, the narrow phase decides.
"""

from __future__ import annotations

import numpy as np

from mobee.engine.compiled import inner
from mobee.engine.layout import BOX, CAPSULE, CORE, HALF, INVERSE, KIND, LENGTH, RADIUS, ROTATION, SPHERE
from mobee.engine.pack import UInts
from mobee.robot.robot import Array

MARGIN = 1e-9  # m: far above rounding, far below what costs time

_0, _1, _2 = (np.uint64(k) for k in range(3))
_3, _4, _5, _6, _7, _8 = (np.uint64(k) for k in range(3, 9))
_CORE, _HALF, _KIND, _RADIUS, _ROTATION = (np.uint64(k) for k in (CORE, HALF, KIND, RADIUS, ROTATION))
_LENGTH, _INVERSE = np.uint64(LENGTH), np.uint64(INVERSE)
_TINY = 1e-30


@inner
def _unit(s: float) -> float:
    return min(max(s, -1.0), 1.0)


@inner
def _point_segment(x: float, y: float, z: float, vx: float, vy: float, vz: float, inverse: float) -> float:
    """Squared distance of a point from the segment from -v to v."""
    t = _unit((vx * x + vy * y + vz * z) * inverse)
    x, y, z = x - t * vx, y - t * vy, z - t * vz
    return x * x + y * y + z * z


@inner
def _segment_segment(
    x: float,
    y: float,
    z: float,
    ux: float,
    uy: float,
    uz: float,
    vx: float,
    vy: float,
    vz: float,
    lengths: tuple[float, float, float, float],
) -> float:
    """Squared distance of the segments w - u .. w + u and -v .. v; parallel ones too, for t and s follow each other."""
    a, per_a, e, per_e = lengths
    b, c, f = ux * vx + uy * vy + uz * vz, ux * x + uy * y + uz * z, vx * x + vy * y + vz * z
    s = _unit((b * f - c * e) / max(a * e - b * b, _TINY))
    t = _unit((b * s + f) * per_e)
    s = _unit((b * t - c) * per_a)
    x, y, z = x + s * ux - t * vx, y + s * uy - t * vy, z + s * uz - t * vz
    return x * x + y * y + z * z


@inner
def _point_box(x: float, y: float, z: float, hx: float, hy: float, hz: float) -> float:
    """Squared distance of a point from a box about the origin."""
    x, y, z = max(abs(x) - hx, 0.0), max(abs(y) - hy, 0.0), max(abs(z) - hz, 0.0)
    return x * x + y * y + z * z


@inner
def _segment_near_box(
    x: float, y: float, z: float, kx: float, ky: float, kz: float, inverse: float, hx: float, hy: float, hz: float, reach: float
) -> bool:
    """False if the segment c - k .. c + k is farther than `reach` from a box about the origin.

    Shown by the box's own axes, or by the direction between two points found by going to and fro twice.
    """
    if _point_box(max(abs(x) - abs(kx), 0.0), max(abs(y) - abs(ky), 0.0), max(abs(z) - abs(kz), 0.0), hx, hy, hz) > reach * reach:
        return False
    s = _unit(-(x * kx + y * ky + z * kz) * inverse)
    nx, ny, nz = 0.0, 0.0, 0.0
    for _ in range(2):
        px, py, pz = x + s * kx, y + s * ky, z + s * kz
        qx, qy, qz = min(max(px, -hx), hx), min(max(py, -hy), hy), min(max(pz, -hz), hz)
        s = _unit(((qx - x) * kx + (qy - y) * ky + (qz - z) * kz) * inverse)
        nx, ny, nz = x + s * kx - qx, y + s * ky - qy, z + s * kz - qz
    gap = nx * x + ny * y + nz * z - abs(nx * kx + ny * ky + nz * kz) - abs(nx) * hx - abs(ny) * hy - abs(nz) * hz
    return gap <= 0.0 or gap * gap < reach * reach * (nx * nx + ny * ny + nz * nz)


@inner
def sieve(slots: Array, first: UInts, second: UInts, pairs: np.uint64) -> np.uint64:
    """Keep the pairs that may overlap, in their order; returns how many."""
    kept = _0
    for p in range(pairs):
        a, b = first[p], second[p]
        first[kept], second[kept] = a, b
        if slots[a + _KIND] > slots[b + _KIND]:
            a, b = b, a
        one, two = slots[a + _KIND], slots[b + _KIND]
        x, y, z = slots[a] - slots[b], slots[a + _1] - slots[b + _1], slots[a + _2] - slots[b + _2]
        reach = slots[a + _RADIUS] + slots[b + _RADIUS] + MARGIN
        near = True
        if two <= CAPSULE:
            vx, vy, vz = slots[b + _CORE], slots[b + _CORE + _1], slots[b + _CORE + _2]
            if one == SPHERE:
                near = _point_segment(x, y, z, vx, vy, vz, slots[b + _INVERSE]) < reach * reach
            else:
                ux, uy, uz = slots[a + _CORE], slots[a + _CORE + _1], slots[a + _CORE + _2]
                lengths = slots[a + _LENGTH], slots[a + _INVERSE], slots[b + _LENGTH], slots[b + _INVERSE]
                near = _segment_segment(x, y, z, ux, uy, uz, vx, vy, vz, lengths) < reach * reach
        elif two == BOX:
            r = b + _ROTATION
            hx, hy, hz = slots[b + _HALF], slots[b + _HALF + _1], slots[b + _HALF + _2]
            cx = x * slots[r] + y * slots[r + _3] + z * slots[r + _6]
            cy = x * slots[r + _1] + y * slots[r + _4] + z * slots[r + _7]
            cz = x * slots[r + _2] + y * slots[r + _5] + z * slots[r + _8]
            if one == SPHERE:
                near = _point_box(cx, cy, cz, hx, hy, hz) < reach * reach
            elif one == CAPSULE:
                ux, uy, uz = slots[a + _CORE], slots[a + _CORE + _1], slots[a + _CORE + _2]
                kx = ux * slots[r] + uy * slots[r + _3] + uz * slots[r + _6]
                ky = ux * slots[r + _1] + uy * slots[r + _4] + uz * slots[r + _7]
                kz = ux * slots[r + _2] + uy * slots[r + _5] + uz * slots[r + _8]
                near = _segment_near_box(cx, cy, cz, kx, ky, kz, slots[a + _INVERSE], hx, hy, hz, reach)
            elif one == BOX:
                s = a + _ROTATION
                dx = x * slots[s] + y * slots[s + _3] + z * slots[s + _6]
                dy = x * slots[s + _1] + y * slots[s + _4] + z * slots[s + _7]
                dz = x * slots[s + _2] + y * slots[s + _5] + z * slots[s + _8]
                along = slots[a + _HALF] * abs(dx) + slots[a + _HALF + _1] * abs(dy) + slots[a + _HALF + _2] * abs(dz)
                squared = x * x + y * y + z * z
                near = squared - MARGIN < along + hx * abs(cx) + hy * abs(cy) + hz * abs(cz)
        kept += _1 if near else _0
    return kept
