"""The vertex, edge or face of a volume that lies farthest along a direction, seen along that direction: points of a plane."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine import layout
from mobee.engine.compiled import inner
from mobee.engine.narrow.slots import FOUR, HALF, KIND, ONE, RADIUS, THREE, TWO, ZERO, Offset, Vector, into, out_of, vector
from mobee.robot.robot import Array

SPHERE, CAPSULE, CYLINDER, BOX, CONVEX = layout.SPHERE, layout.CAPSULE, layout.CYLINDER, layout.BOX, layout.CONVEX
ALIGNED = 1e-6  # sine of the angle below which a direction counts as square to an edge or a face
CORNERS = np.uint64(32)  # of the polygon that stands for a cap


@inner
def most_corners(P: Array, i: Offset) -> Offset:
    """How many points the feature of a volume has at most."""
    kind = P[i + KIND]
    if kind == CONVEX:
        return np.uint64(P[i + HALF + ONE])
    return CORNERS if kind == CYLINDER else FOUR


@inner
def feature(P: Array, i: Offset, V: Array, n: Vector, t: Vector, u: Vector, c: Vector, out: Array) -> Offset:
    """Write the corners, in order round the feature that is farthest along n, as coordinates along t and u; how many.

    c is the volume's centre from the plane's origin; n, t, u and c are in the root frame.
    """
    kind = P[i + KIND]
    nx, ny, nz = into(P, i, n[0], n[1], n[2])
    hx, hy, hz = vector(P, i + HALF)
    if kind == CONVEX:
        return _convex(P, i, V, (nx, ny, nz), t, u, c, out)
    # Others: a point and up to two half edges across the direction, or a cap.
    z = _at(nz, hz if kind == BOX else hy if kind != SPHERE else 0.0)
    side = math.sqrt(nx * nx + ny * ny)
    x, y, corners = 0.0, 0.0, ONE
    if kind == BOX:
        x, y = _at(nx, hx), _at(ny, hy)
    elif kind == CYLINDER:
        if side < ALIGNED:
            corners = CORNERS
        else:
            x, y = hx * nx / side, hx * ny / side
    dx, dy, dz = (hx - abs(x), hy - abs(y), hz - abs(z)) if kind == BOX else (0.0, 0.0, hy - abs(z) if kind != SPHERE else 0.0)
    flat = (dx > 0.0) + (dy > 0.0) + (dz > 0.0)
    if flat > 0:
        corners = TWO if flat == 1 else FOUR
    for corner in range(corners):
        # Round a square; a single edge takes the first two corners of it, which differ in both signs.
        one, two = (1.0 if corner == ZERO or corner == THREE else -1.0), (1.0 if corner < TWO else -1.0)
        if flat == 1:
            two = one
        if corners == CORNERS:
            angle = 2.0 * math.pi * corner / CORNERS
            px, py, pz = hx * math.cos(angle), hx * math.sin(angle), z
        elif dx > 0.0:
            px, py, pz = x + one * dx, y + two * dy, z + two * dz
        else:
            px, py, pz = x, y + one * dy, z + two * dz
        _put(P, i, t, u, c, px, py, pz, corner, out)
    return corners


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
def _put(P: Array, i: Offset, t: Vector, u: Vector, c: Vector, x: float, y: float, z: float, at: Offset, out: Array) -> None:
    x, y, z = out_of(P, i, x, y, z)
    x, y, z = x + c[0], y + c[1], z + c[2]
    k = at * TWO
    out[k] = t[0] * x + t[1] * y + t[2] * z
    out[k + ONE] = u[0] * x + u[1] * y + u[2] * z


@inner
def _convex(P: Array, i: Offset, V: Array, n: Vector, t: Vector, u: Vector, c: Vector, out: Array) -> Offset:
    """The feature of a convex hull, n in its own axes: the outline of the vertices that are farthest, within rounding."""
    first, count = np.uint64(P[i + HALF]), np.uint64(P[i + HALF + ONE])
    farthest, size = -math.inf, 0.0
    for k in range(count):
        x, y, z = vector(V, (first + k) * np.uint64(3))
        farthest = max(farthest, n[0] * x + n[1] * y + n[2] * z)
        size = max(size, abs(x), abs(y), abs(z))
    found = ZERO
    for k in range(count):
        x, y, z = vector(V, (first + k) * np.uint64(3))
        if n[0] * x + n[1] * y + n[2] * z >= farthest - ALIGNED * size:
            _put(P, i, t, u, c, x, y, z, found, out)
            found += ONE
    return outline(out, found, ALIGNED * size)


@inner
def outline(points: Array, count: Offset, near: float) -> Offset:
    """Keep, in order, the corners of the convex hull of points of the plane (x, y each); how many (Jarvis's march)."""
    current = ZERO
    for k in range(ONE, count):
        ahead = points[k * TWO] - points[current * TWO]
        if ahead < -near or (ahead <= near and points[k * TWO + ONE] < points[current * TWO + ONE]):
            current = k
    kept = ZERO
    while True:
        for k in range(TWO):
            points[kept * TWO + k], points[current * TWO + k] = points[current * TWO + k], points[kept * TWO + k]
        x, y = points[kept * TWO], points[kept * TWO + ONE]
        kept += ONE
        # The start competes, too: choosing it ends the march.
        following, fx, fy = ZERO, points[ZERO] - x, points[ONE] - y
        for k in range(kept, count):
            dx, dy = points[k * TWO] - x, points[k * TWO + ONE] - y
            turn, old, new = fx * dy - fy * dx, math.sqrt(fx * fx + fy * fy), math.sqrt(dx * dx + dy * dy)
            if new > near and (old <= near or turn < -near * new or (turn <= near * new and new > old and fx * dx + fy * dy > 0.0)):
                following, fx, fy = k, dx, dy
        if following == ZERO:
            return kept
        current = following
