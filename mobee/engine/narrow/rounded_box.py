"""Spheres and capsules with boxes: a point or a segment inflated by a radius, seen from the box."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inlined, inner
from mobee.engine.narrow.segment_box import closest_to_box, distance_bound, span_within
from mobee.engine.narrow.slots import (
    CENTER,
    CORE,
    FLAT,
    HALF,
    RADIUS,
    TIE,
    TOUCHING,
    Offset,
    Vector,
    centers_apart,
    into,
    out_of,
    sign,
    store,
    unit,
    vector,
)
from mobee.robot.robot import Array


@inner
def sphere_box(P: Array, a: int, b: int, out: Array) -> float:
    """See `overlap`."""
    i, j = np.uint64(a), np.uint64(b)
    x, y, z = centers_apart(P, i, j)
    x, y, z = into(P, j, x, y, z)
    kx, ky, kz = vector(P, j + HALF)
    dx, dy, dz = _beyond(x, kx), _beyond(y, ky), _beyond(z, kz)
    squared = dx * dx + dy * dy + dz * dz
    radius = P[i + RADIUS]
    if squared >= radius * radius:
        return radius - math.sqrt(squared)
    if squared > TOUCHING * TOUCHING:
        return _outside(P, i, j, (x, y, z), (dx, dy, dz), math.sqrt(squared), out)
    return _pierced(P, i, j, (x, y, z), (0.0, 0.0, 0.0), out)


@inner
def capsule_box(P: Array, a: int, b: int, out: Array) -> float:
    """See `overlap`; cheap bounds of the distance come first."""
    i, j = np.uint64(a), np.uint64(b)
    x, y, z = centers_apart(P, i, j)
    x, y, z = into(P, j, x, y, z)
    hx, hy, hz = vector(P, i + CORE)
    hx, hy, hz = into(P, j, hx, hy, hz)
    kx, ky, kz = vector(P, j + HALF)
    radius = P[i + RADIUS]
    bound = distance_bound(x, y, z, hx, hy, hz, kx, ky, kz)
    if bound >= radius:
        return radius - bound
    s = closest_to_box(x, y, z, hx, hy, hz, kx, ky, kz)
    px, py, pz = x + s * hx, y + s * hy, z + s * hz
    dx, dy, dz = _beyond(px, kx), _beyond(py, ky), _beyond(pz, kz)
    squared = dx * dx + dy * dy + dz * dz
    if squared >= radius * radius:
        return radius - math.sqrt(squared)
    if squared > TOUCHING * TOUCHING:
        depth = _outside(P, i, j, (px, py, pz), (dx, dy, dz), math.sqrt(squared), out)
    else:
        depth = _pierced(P, i, j, (x, y, z), (hx, hy, hz), out)
    return depth


@inner
def capsule_box_distance(P: Array, a: int, b: int) -> float:
    """How far the two are apart [m], exactly; 0 if they overlap."""
    i, j = np.uint64(a), np.uint64(b)
    x, y, z = centers_apart(P, i, j)
    x, y, z = into(P, j, x, y, z)
    hx, hy, hz = vector(P, i + CORE)
    hx, hy, hz = into(P, j, hx, hy, hz)
    kx, ky, kz = vector(P, j + HALF)
    s = closest_to_box(x, y, z, hx, hy, hz, kx, ky, kz)
    dx, dy, dz = _beyond(x + s * hx, kx), _beyond(y + s * hy, ky), _beyond(z + s * hz, kz)
    return max(math.sqrt(dx * dx + dy * dy + dz * dz) - P[i + RADIUS], 0.0)


@inlined
def _beyond(x: float, k: float) -> float:
    return x - min(max(x, -k), k)


@inlined
def _outside(P: Array, i: Offset, j: Offset, p: Vector, d: Vector, distance: float, out: Array) -> float:
    """The contact of a point p of the core that is outside the box, at d from the nearest point of it."""
    back = (P[i + RADIUS] + distance) / 2.0
    normal = d[0] / distance, d[1] / distance, d[2] / distance
    _store(P, j, normal, (p[0] - back * normal[0], p[1] - back * normal[1], p[2] - back * normal[2]), out)
    return P[i + RADIUS] - distance


@inlined
def _pierced(P: Array, i: Offset, j: Offset, c: Vector, h: Vector, out: Array) -> float:
    """The contact of a core c + s h that meets the box: out through a face of the box, or of the box swept along the core."""
    (x, y, z), (hx, hy, hz), (kx, ky, kz) = c, h, vector(P, j + HALF)
    ax, ay, az = abs(hx), abs(hy), abs(hz)
    nx, ny, nz = sign(x), 0.0, 0.0
    sink = kx + ax - nx * x
    other = ky + ay - sign(y) * y
    if other < sink - TIE:
        sink, nx, ny = other, 0.0, sign(y)
    other = kz + az - sign(z) * z
    if other < sink - TIE:
        sink, nx, ny, nz = other, 0.0, 0.0, sign(z)
    least = FLAT * FLAT * (hx * hx + hy * hy + hz * hz)
    edge = -1
    length = hy * hy + hz * hz
    if length > least:
        length = math.sqrt(length)
        far = (z * hy - y * hz) / length
        other = (ky * az + kz * ay) / length - sign(far) * far
        if other < sink - TIE:
            edge, sink, nx, ny, nz = 0, other, 0.0, -sign(far) * hz / length, sign(far) * hy / length
    length = hz * hz + hx * hx
    if length > least:
        length = math.sqrt(length)
        far = (x * hz - z * hx) / length
        other = (kz * ax + kx * az) / length - sign(far) * far
        if other < sink - TIE:
            edge, sink, nx, ny, nz = 1, other, sign(far) * hz / length, 0.0, -sign(far) * hx / length
    length = hx * hx + hy * hy
    if length > least:
        length = math.sqrt(length)
        far = (y * hx - x * hy) / length
        other = (kx * ay + ky * ax) / length - sign(far) * far
        if other < sink - TIE:
            edge, sink, nx, ny, nz = 2, other, -sign(far) * hy / length, sign(far) * hx / length, 0.0
    s = _deepest(c, h, (kx, ky, kz), (nx, ny, nz), sink, edge, least)
    back = (P[i + RADIUS] - sink) / 2.0
    point = x + s * hx - back * nx, y + s * hy - back * ny, z + s * hz - back * nz
    _store(P, j, (nx, ny, nz), point, out)
    return P[i + RADIUS] + sink


@inlined
def _deepest(c: Vector, h: Vector, k: Vector, n: Vector, sink: float, edge: int, least: float) -> float:
    """Where on the core c + s h the deepest point is, on the way n out of the box: an end, or above the middle of what meets."""
    if edge >= 0:
        # Moved out by n * sink, the core crosses the box's edge.
        x = h[0] if edge != 0 else 0.0
        y = h[1] if edge != 1 else 0.0
        z = h[2] if edge != 2 else 0.0
        along = x * (math.copysign(k[0], n[0]) - c[0] - sink * n[0])
        along += y * (math.copysign(k[1], n[1]) - c[1] - sink * n[1])
        along += z * (math.copysign(k[2], n[2]) - c[2] - sink * n[2])
        return unit(along / (x * x + y * y + z * z))
    slope = n[0] * h[0] + n[1] * h[1] + n[2] * h[2]
    if slope * slope > least:
        return -1.0 if slope > 0.0 else 1.0
    x0, x1 = span_within(c[0], h[0], k[0], least)
    y0, y1 = span_within(c[1], h[1], k[1], least)
    z0, z1 = span_within(c[2], h[2], k[2], least)
    return unit((max(x0, y0, z0, -1.0) + min(x1, y1, z1, 1.0)) / 2.0)


@inlined
def _store(P: Array, j: Offset, normal: Vector, point: Vector, out: Array) -> None:
    """Write a contact given in the box's own axes."""
    x, y, z = out_of(P, j, point[0], point[1], point[2])
    bx, by, bz = vector(P, j + CENTER)
    store(out, out_of(P, j, normal[0], normal[1], normal[2]), (x + bx, y + by, z + bz))
