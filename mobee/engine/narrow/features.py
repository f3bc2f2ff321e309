"""The vertex, edge or face of a volume that lies farthest along a direction, seen along that direction: points of a plane."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine import layout
from mobee.engine.compiled import inner
from mobee.engine.narrow.slots import HALF, KIND, ONE, RADIUS, TWO, Offset, Vector, into, out_of, vector
from mobee.robot.robot import Array

SPHERE, CAPSULE, CYLINDER, BOX, CONVEX = layout.SPHERE, layout.CAPSULE, layout.CYLINDER, layout.BOX, layout.CONVEX
ALIGNED = 1e-6  # sine of the angle below which a direction counts as square to an edge or a face
CORNERS = 32  # of the polygon that stands for a cap


@inner
def most_corners(P: Array, i: Offset) -> int:
    """How many points the feature of a volume has at most."""
    kind = P[i + KIND]
    if kind == CONVEX:
        return int(P[i + HALF + ONE])
    return CORNERS if kind == CYLINDER else 4


@inner
def feature(P: Array, i: Offset, V: Array, n: Vector, t: Vector, u: Vector, c: Vector, out: Array) -> int:
    """Write the corners, in order round the feature that is farthest along n, as coordinates along t and u; how many.

    c is the volume's centre from the plane's origin; n, t, u and c are in the root frame.
    """
    kind = P[i + KIND]
    nx, ny, nz = into(P, i, n[0], n[1], n[2])
    hx, hy, hz = vector(P, i + HALF)
    if kind == BOX:
        x, y, z = _at(nx, hx), _at(ny, hy), _at(nz, hz)
        dx, dy, dz = hx - abs(x), hy - abs(y), hz - abs(z)
        flat = (dx > 0.0) + (dy > 0.0) + (dz > 0.0)
        if flat == 1:
            _put(P, i, t, u, c, x - dx, y - dy, z - dz, 0, out)
            _put(P, i, t, u, c, x + dx, y + dy, z + dz, 1, out)
            return 2
        if flat == 0:
            _put(P, i, t, u, c, x, y, z, 0, out)
            return 1
        for corner in range(4):
            one = -1.0 if corner < 2 else 1.0
            two = -1.0 if 0 < corner < 3 else 1.0
            if dz == 0.0:
                _put(P, i, t, u, c, x + one * dx, y + two * dy, z, corner, out)
            elif dy == 0.0:
                _put(P, i, t, u, c, x + one * dx, y, z + two * dz, corner, out)
            else:
                _put(P, i, t, u, c, x, y + one * dy, z + two * dz, corner, out)
        return 4
    if kind == CONVEX:
        return _convex(P, i, V, (nx, ny, nz), t, u, c, out)
    z = _at(nz, hy) if kind != SPHERE else 0.0
    side = math.sqrt(nx * nx + ny * ny)
    x = y = 0.0
    if kind == CYLINDER:
        if side < ALIGNED:
            for corner in range(CORNERS):
                angle = 2.0 * math.pi * corner / CORNERS
                _put(P, i, t, u, c, hx * math.cos(angle), hx * math.sin(angle), z, corner, out)
            return CORNERS
        x, y = hx * nx / side, hx * ny / side
    if kind == SPHERE or z != 0.0:
        _put(P, i, t, u, c, x, y, z, 0, out)
        return 1
    _put(P, i, t, u, c, x, y, -hy, 0, out)
    _put(P, i, t, u, c, x, y, hy, 1, out)
    return 2


@inner
def reach(P: Array, i: Offset, V: Array, n: Vector) -> float:
    """How far a volume reaches along a unit direction of the root frame, from its centre [m]."""
    kind = P[i + KIND]
    nx, ny, nz = into(P, i, n[0], n[1], n[2])
    hx, hy, hz = vector(P, i + HALF)
    if kind == BOX:
        return hx * abs(nx) + hy * abs(ny) + hz * abs(nz)
    if kind == CONVEX:
        farthest = -math.inf
        first = np.uint64(hx)
        for k in range(np.uint64(hy)):
            x, y, z = vector(V, (first + k) * np.uint64(3))
            farthest = max(farthest, nx * x + ny * y + nz * z)
        return farthest
    if kind == CYLINDER:
        return hx * math.sqrt(nx * nx + ny * ny) + hy * abs(nz)
    return P[i + RADIUS] + (hy * abs(nz) if kind == CAPSULE else 0.0)


@inner
def _at(slope: float, half: float) -> float:
    """The coordinate of the end farthest along a direction; the middle if both are as far."""
    if abs(slope) < ALIGNED:
        return 0.0
    return half if slope > 0.0 else -half


@inner
def _put(P: Array, i: Offset, t: Vector, u: Vector, c: Vector, x: float, y: float, z: float, at: int, out: Array) -> None:
    x, y, z = out_of(P, i, x, y, z)
    x, y, z = x + c[0], y + c[1], z + c[2]
    k = np.uint64(at) * TWO
    out[k] = t[0] * x + t[1] * y + t[2] * z
    out[k + ONE] = u[0] * x + u[1] * y + u[2] * z


@inner
def _convex(P: Array, i: Offset, V: Array, n: Vector, t: Vector, u: Vector, c: Vector, out: Array) -> int:
    """The feature of a convex hull, n in its own axes: the outline of the vertices that are farthest, within rounding."""
    first, count = np.uint64(P[i + HALF]), np.uint64(P[i + HALF + ONE])
    farthest, size = -math.inf, 0.0
    for k in range(count):
        x, y, z = vector(V, (first + k) * np.uint64(3))
        farthest = max(farthest, n[0] * x + n[1] * y + n[2] * z)
        size = max(size, abs(x), abs(y), abs(z))
    found = 0
    for k in range(count):
        x, y, z = vector(V, (first + k) * np.uint64(3))
        if n[0] * x + n[1] * y + n[2] * z >= farthest - ALIGNED * size:
            _put(P, i, t, u, c, x, y, z, found, out)
            found += 1
    return outline(out, found, ALIGNED * size)


@inner
def outline(points: Array, count: int, near: float) -> int:
    """Keep, in order, the corners of the convex hull of points of the plane (x, y each); how many (Jarvis's march)."""
    start = 0
    for k in range(1, count):
        ahead = points[2 * k] - points[2 * start]
        if ahead < -near or (ahead <= near and points[2 * k + 1] < points[2 * start + 1]):
            start = k
    kept, current = 0, start
    while True:
        points[2 * kept], points[2 * current] = points[2 * current], points[2 * kept]
        points[2 * kept + 1], points[2 * current + 1] = points[2 * current + 1], points[2 * kept + 1]
        x, y = points[2 * kept], points[2 * kept + 1]
        kept += 1
        # The start competes too: choosing it ends the march.
        following, fx, fy = 0, points[0] - x, points[1] - y
        for k in range(kept, count):
            dx, dy = points[2 * k] - x, points[2 * k + 1] - y
            turn, old, new = fx * dy - fy * dx, math.sqrt(fx * fx + fy * fy), math.sqrt(dx * dx + dy * dy)
            if new <= near:
                continue
            if old <= near or turn < -near * new or (turn <= near * new and new > old and fx * dx + fy * dy > 0.0):
                following, fx, fy = k, dx, dy
        if following == 0:
            return kept
        current = following
