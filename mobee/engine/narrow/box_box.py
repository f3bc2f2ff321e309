"""Two boxes: the separating axis theorem, over the faces of both and the crossings of their edges."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inner
from mobee.engine.narrow.features import ALIGNED
from mobee.engine.narrow.middle import store_contact
from mobee.engine.narrow.slots import (
    CENTER,
    FLAT,
    HALF,
    TIE,
    Offset,
    Vector,
    centers_apart,
    into,
    out_of,
    own_axis,
    sign,
    store,
    vector,
)
from mobee.robot.robot import Array

_X, _Y, _Z = np.uint64(0), np.uint64(1), np.uint64(2)


@inner
def box_box(P: Array, a: int, b: int, V: Array, out: Array) -> float:
    """See `overlap`; the bound of the distance is the gap along the axis that separates."""
    i, j = np.uint64(a), np.uint64(b)
    x, y, z = centers_apart(P, i, j)
    tx, ty, tz = into(P, i, x, y, z)
    hx, hy, hz = vector(P, i + HALF)
    kx, ky, kz = vector(P, j + HALF)
    # Columns: the second box's axes, seen from the first.
    x0, y0, z0 = own_axis(P, j, _X)
    x0, y0, z0 = into(P, i, x0, y0, z0)
    x1, y1, z1 = own_axis(P, j, _Y)
    x1, y1, z1 = into(P, i, x1, y1, z1)
    x2, y2, z2 = own_axis(P, j, _Z)
    x2, y2, z2 = into(P, i, x2, y2, z2)
    ax0, ay0, az0, ax1, ay1, az1, ax2, ay2, az2 = abs(x0), abs(y0), abs(z0), abs(x1), abs(y1), abs(z1), abs(x2), abs(y2), abs(z2)
    rx, ry, rz = hx + kx * ax0 + ky * ax1 + kz * ax2, hy + kx * ay0 + ky * ay1 + kz * ay2, hz + kx * az0 + ky * az1 + kz * az2
    apart = min(rx - abs(tx), ry - abs(ty), rz - abs(tz))
    if apart <= 0.0:
        return apart
    u0, u1, u2 = x0 * tx + y0 * ty + z0 * tz, x1 * tx + y1 * ty + z1 * tz, x2 * tx + y2 * ty + z2 * tz
    r0, r1, r2 = hx * ax0 + hy * ay0 + hz * az0 + kx, hx * ax1 + hy * ay1 + hz * az1 + ky, hx * ax2 + hy * ay2 + hz * az2 + kz
    apart = min(r0 - abs(u0), r1 - abs(u1), r2 - abs(u2))
    if apart <= 0.0:
        return apart
    # Across the first's axis x (y, z) and each of the second's.
    xx, xy, xz = (
        _edges(tz * y0 - ty * z0, hy * az0 + hz * ay0 + ky * ax2 + kz * ax1, y0, z0),
        _edges(tz * y1 - ty * z1, hy * az1 + hz * ay1 + kx * ax2 + kz * ax0, y1, z1),
        _edges(tz * y2 - ty * z2, hy * az2 + hz * ay2 + kx * ax1 + ky * ax0, y2, z2),
    )
    apart = min(xx, xy, xz)
    if apart <= 0.0:
        return apart
    yx, yy, yz = (
        _edges(tx * z0 - tz * x0, hx * az0 + hz * ax0 + ky * ay2 + kz * ay1, x0, z0),
        _edges(tx * z1 - tz * x1, hx * az1 + hz * ax1 + kx * ay2 + kz * ay0, x1, z1),
        _edges(tx * z2 - tz * x2, hx * az2 + hz * ax2 + kx * ay1 + ky * ay0, x2, z2),
    )
    apart = min(yx, yy, yz)
    if apart <= 0.0:
        return apart
    zx, zy, zz = (
        _edges(ty * x0 - tx * y0, hx * ay0 + hy * ax0 + ky * az2 + kz * az1, x0, y0),
        _edges(ty * x1 - tx * y1, hx * ay1 + hy * ax1 + kx * az2 + kz * az0, x1, y1),
        _edges(ty * x2 - tx * y2, hx * ay2 + hy * ax2 + kx * az1 + ky * az0, x2, y2),
    )
    apart = min(zx, zy, zz)
    if apart <= 0.0:
        return apart
    least, depth = 0, rx - abs(tx)
    others = ry - abs(ty), rz - abs(tz), r0 - abs(u0), r1 - abs(u1), r2 - abs(u2), xx, xy, xz, yx, yy, yz, zx, zy, zz
    for k in range(14):
        if others[k] < depth - TIE:
            least, depth = k + 1, others[k]
    nx, ny, nz = _direction(P, i, j, least)
    far = sign(nx * x + ny * y + nz * z)
    _store(P, i, j, V, (far * nx, far * ny, far * nz), depth, out)
    return depth


@inner
def _store(P: Array, i: Offset, j: Offset, V: Array, n: Vector, depth: float, out: Array) -> None:
    """Write the contact: at a corner if one of the boxes is met there."""
    back = depth / 2.0
    ax, ay, az = into(P, i, -n[0], -n[1], -n[2])
    bx, by, bz = into(P, j, n[0], n[1], n[2])
    if min(abs(ax), abs(ay), abs(az)) > ALIGNED:
        met, x, y, z = i, ax, ay, az
    elif min(abs(bx), abs(by), abs(bz)) > ALIGNED:
        met, x, y, z, back = j, bx, by, bz, -back
    else:
        store_contact(P, i, j, V, n, depth, out)
        return
    hx, hy, hz = vector(P, met + HALF)
    x, y, z = out_of(P, met, math.copysign(hx, x), math.copysign(hy, y), math.copysign(hz, z))
    cx, cy, cz = vector(P, met + CENTER)
    store(out, n, (cx + x + back * n[0], cy + y + back * n[1], cz + z + back * n[2]))


@inner
def _edges(t: float, r: float, p: float, q: float) -> float:
    """The overlap across two edges, not yet divided by the length hypot(p, q) of their cross product; no matter if parallel."""
    squared = p * p + q * q
    return (r - abs(t)) / math.sqrt(squared) if squared > FLAT * FLAT else math.inf


@inner
def _direction(P: Array, i: Offset, j: Offset, which: int) -> Vector:
    """The unit vector of one of the fifteen axes, root frame."""
    if which < 3:
        return own_axis(P, i, np.uint64(which))
    if which < 6:
        return own_axis(P, j, np.uint64(which - 3))
    ax, ay, az = own_axis(P, i, np.uint64((which - 6) // 3))
    bx, by, bz = own_axis(P, j, np.uint64((which - 6) % 3))
    x, y, z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length
