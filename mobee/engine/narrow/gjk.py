"""The algorithm of Gilbert, Johnson and Keerthi: the point of a Minkowski difference that is closest to the origin."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inner, inner_with_memory
from mobee.engine.narrow.difference import farthest
from mobee.engine.narrow.slots import FOUR, ONE, THREE, TWO, ZERO, Offset, Vector, vector
from mobee.robot.robot import Array

_STEPS = 100
_EXACT = 1e-15  # relative: the bounds have met
_ORIGIN = 1e-12  # m: what is so close to the origin holds it
_THIN = 1e-28  # squared sine of the angle below which a triangle is one of its sides
_FLAT = 1e-24  # squared sine of the angle below which a tetrahedron is one of its faces
_NOWHERE = (0.0, 0.0, 0.0)


@inner_with_memory
def closest(P: Array, i: Offset, j: Offset, V: Array, frame: Array, limit: float) -> tuple[float, Vector]:
    """The distance of two cores [m] and the closest point of their difference b - a, in the first's axes; 0 if they overlap.

    Once the distance is known to be larger than `limit`, a lower bound of it that is larger, too.
    """
    corners = np.empty(12)
    count, squared = ZERO, math.inf
    x, y, z = frame[0], frame[1], frame[2]
    distance = math.sqrt(x * x + y * y + z * z)
    for _ in range(_STEPS):
        if distance < _ORIGIN:
            if count > ZERO:
                return 0.0, _NOWHERE
            x, distance = 1.0, 1.0
        p = farthest(P, i, j, V, frame, -x, -y, -z)
        bound = (x * p[0] + y * p[1] + z * p[2]) / distance
        if bound > limit:
            return bound, (x, y, z)
        if count > ZERO and distance - bound <= _EXACT * distance:
            break
        _set(corners, count, p)
        count, (nx, ny, nz) = _reduce(corners, count + ONE, bound > 0.0)
        if count == FOUR:
            return 0.0, _NOWHERE
        nearer = nx * nx + ny * ny + nz * nz
        if nearer >= squared:
            break
        x, y, z, squared = nx, ny, nz, nearer
        distance = math.sqrt(squared)
    return distance, (x, y, z)


@inner
def _set(corners: Array, at: Offset, point: Vector) -> None:
    k = at * THREE
    corners[k], corners[k + ONE], corners[k + TWO] = point


@inner
def _reduce(corners: Array, count: Offset, apart: bool) -> tuple[Offset, Vector]:
    """Keep the corners of a simplex that span its point closest to the origin; how many, and the point.  4: it is inside.

    What is known to be apart from the origin does not hold it, whatever rounding says of a thin tetrahedron.
    """
    if count == ONE:
        return ONE, vector(corners, ZERO)
    # Of up to four triangles; fewer corners are a triangle with corners given twice.
    face, kept, point, least = FOUR, ZERO, _NOWHERE, math.inf
    for other in range(FOUR if count == FOUR else ONE):
        a, b, c = _others(other, count)
        p, q, r = vector(corners, a * THREE), vector(corners, b * THREE), vector(corners, c * THREE)
        if count < FOUR or apart or _beyond(p, q, r, vector(corners, other * THREE)):
            here, (x, y, z) = _on_triangle(p, q, r)
            squared = x * x + y * y + z * z
            if squared < least:
                face, kept, point, least = other, here, (x, y, z), squared
    if face == FOUR:
        return FOUR, point
    left = ZERO
    a, b, c = _others(face, count)
    if kept & ONE:
        _set(corners, left, vector(corners, a * THREE))
        left += ONE
    if kept & TWO:
        _set(corners, left, vector(corners, b * THREE))
        left += ONE
    if kept & FOUR:
        _set(corners, left, vector(corners, c * THREE))
        left += ONE
    return left, point


@inner
def _others(other: Offset, count: Offset) -> tuple[Offset, Offset, Offset]:
    """The corners of a face, in order: those of four that are not `other`; of fewer all, the last one twice if they are two."""
    if count < FOUR:
        return ZERO, ONE, count - ONE
    return (ONE if other == ZERO else ZERO), (ONE if other > ONE else TWO), (TWO if other == THREE else THREE)


@inner
def _beyond(p: Vector, q: Vector, r: Vector, other: Vector) -> bool:
    """Whether the origin and the other corner are not on the same side of the face p, q, r; so, too, if the four are flat."""
    nx, ny, nz = _normal(p, q, r)
    ox, oy, oz = other[0] - p[0], other[1] - p[1], other[2] - p[2]
    side, origin = nx * ox + ny * oy + nz * oz, -(nx * p[0] + ny * p[1] + nz * p[2])
    flat = side * side <= _FLAT * (nx * nx + ny * ny + nz * nz) * (ox * ox + oy * oy + oz * oz)
    return flat or origin * side <= 0.0


@inner
def _on_triangle(p: Vector, q: Vector, r: Vector) -> tuple[Offset, Vector]:
    """The point of a triangle closest to the origin, and which corners (bits 1, 2, 4) span the face, side or corner it lies on."""
    nx, ny, nz = _normal(p, q, r)
    squared = nx * nx + ny * ny + nz * nz
    thin = squared <= _THIN * _squared(p, q) * _squared(p, r)
    if not (thin or _outside(p, q, nx, ny, nz) or _outside(q, r, nx, ny, nz) or _outside(r, p, nx, ny, nz)):
        # Through the normal: exact also where the triangle is narrow.
        w = (nx * p[0] + ny * p[1] + nz * p[2]) / squared
        return ONE | TWO | FOUR, (w * nx, w * ny, w * nz)
    kept, point, least = ZERO, _NOWHERE, math.inf
    for side in range(THREE):
        start, end = (q if side == ONE else p), (q if side == ZERO else r)
        ux, uy, uz = end[0] - start[0], end[1] - start[1], end[2] - start[2]
        along, length = -(ux * start[0] + uy * start[1] + uz * start[2]), ux * ux + uy * uy + uz * uz
        w = 0.0 if along <= 0.0 else 1.0 if along >= length else along / length
        x, y, z = start[0] + w * ux, start[1] + w * uy, start[2] + w * uz
        squared = x * x + y * y + z * z
        if squared < least:
            first, last = (TWO if side == ONE else ONE), (TWO if side == ZERO else FOUR)
            kept = first if w == 0.0 else last if w == 1.0 else first | last
            point, least = (x, y, z), squared
    return kept, point


@inner
def _outside(p: Vector, q: Vector, nx: float, ny: float, nz: float) -> bool:
    """Whether, seen against n, the origin is to the right of the line from p to q."""
    x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    return nx * (y * p[2] - z * p[1]) + ny * (z * p[0] - x * p[2]) + nz * (x * p[1] - y * p[0]) > 0.0


@inner
def _squared(p: Vector, q: Vector) -> float:
    x, y, z = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    return x * x + y * y + z * z


@inner
def _normal(p: Vector, q: Vector, r: Vector) -> Vector:
    ux, uy, uz, vx, vy, vz = q[0] - p[0], q[1] - p[1], q[2] - p[2], r[0] - p[0], r[1] - p[1], r[2] - p[2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
