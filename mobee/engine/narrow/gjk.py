"""The algorithm of Gilbert, Johnson and Keerthi: the point of a Minkowski difference that is closest to the origin."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inner
from mobee.engine.narrow.difference import farthest
from mobee.engine.narrow.slots import Offset, Vector
from mobee.robot.robot import Array

_STEPS = 100
_EXACT = 1e-15  # relative: the bounds have met
_THIN = 1e-28  # squared sine of the angle below which a triangle is one of its sides
_ZERO = 1e-12  # m: so close to the origin, it belongs to the difference


@inner
def closest(P: Array, i: Offset, j: Offset, V: Array, frame: Array, limit: float) -> tuple[float, Vector]:
    """The distance of two cores [m] and the closest point of their difference b - a, in the first's axes; 0 if they overlap.

    Once the distance is known to be larger than `limit`, a lower bound of it that is larger, too.
    """
    corners = np.empty(12)
    x, y, z = -frame[0], -frame[1], -frame[2]
    x, y, z = farthest(P, i, j, V, frame, x, y, z)
    corners[0], corners[1], corners[2] = x, y, z
    count, squared = 1, x * x + y * y + z * z
    for _ in range(_STEPS):
        distance = math.sqrt(squared)
        if distance < _ZERO:
            break
        px, py, pz = farthest(P, i, j, V, frame, -x, -y, -z)
        bound = (x * px + y * py + z * pz) / distance
        if bound > limit:
            return bound, (x, y, z)
        if distance - bound <= _EXACT * distance:
            return distance, (x, y, z)
        corners[3 * count], corners[3 * count + 1], corners[3 * count + 2] = px, py, pz
        count, (nx, ny, nz) = _reduce(corners, count + 1)
        nearer = nx * nx + ny * ny + nz * nz
        if count == 4:
            break
        if nearer >= squared:
            return distance, (x, y, z)
        x, y, z, squared = nx, ny, nz, nearer
    else:
        return math.sqrt(squared), (x, y, z)
    return 0.0, (0.0, 0.0, 0.0)


@inner
def _reduce(corners: Array, count: int) -> tuple[int, Vector]:
    """Keep the corners of a simplex that span its point closest to the origin; how many, and the point.  4: it is inside."""
    if count == 2:
        kept, point = _on_segment(corners, 0, 1, 1, 2)
        return _keep(corners, kept, 0, 1, 1), point
    if count == 3:
        kept, point = _on_triangle(corners, 0, 1, 2)
        return _keep(corners, kept, 0, 1, 2), point
    least, kept, face, point = math.inf, 0, -1, (0.0, 0.0, 0.0)
    for other in range(4):
        a, b, c = (1, 2, 3) if other == 0 else (0, 2, 3) if other == 1 else (0, 1, 3) if other == 2 else (0, 1, 2)
        if _beyond(corners, a, b, c, other):
            here, (x, y, z) = _on_triangle(corners, a, b, c)
            squared = x * x + y * y + z * z
            if squared < least:
                least, kept, face, point = squared, here, other, (x, y, z)
    if face < 0:
        return 4, point
    a, b, c = (1, 2, 3) if face == 0 else (0, 2, 3) if face == 1 else (0, 1, 3) if face == 2 else (0, 1, 2)
    return _keep(corners, kept, a, b, c), point


@inner
def _keep(corners: Array, kept: int, a: int, b: int, c: int) -> int:
    count = 0
    for bit in range(3):
        if kept & (1 << bit):
            which = a if bit == 0 else b if bit == 1 else c
            for k in range(3):
                corners[3 * count + k] = corners[3 * which + k]
            count += 1
    return count


@inner
def _corner(corners: Array, a: int) -> Vector:
    k = np.uint64(3 * a)
    return corners[k], corners[k + np.uint64(1)], corners[k + np.uint64(2)]


@inner
def _beyond(corners: Array, a: int, b: int, c: int, other: int) -> bool:
    """Whether the origin and the other corner are not on the same side of the face a, b, c."""
    ax, ay, az = _corner(corners, a)
    bx, by, bz = _corner(corners, b)
    cx, cy, cz = _corner(corners, c)
    ox, oy, oz = _corner(corners, other)
    bx, by, bz, cx, cy, cz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    side = nx * (ox - ax) + ny * (oy - ay) + nz * (oz - az)
    origin = -(nx * ax + ny * ay + nz * az)
    return origin * side <= 0.0


@inner
def _on_segment(corners: Array, a: int, b: int, a_bit: int, b_bit: int) -> tuple[int, Vector]:
    """The point of a segment closest to the origin, and the bits of the corners that it needs."""
    ax, ay, az = _corner(corners, a)
    bx, by, bz = _corner(corners, b)
    ux, uy, uz = bx - ax, by - ay, bz - az
    along, squared = -(ux * ax + uy * ay + uz * az), ux * ux + uy * uy + uz * uz
    if along <= 0.0 or squared == 0.0:
        return a_bit, (ax, ay, az)
    if along >= squared:
        return b_bit, (bx, by, bz)
    w = along / squared
    return a_bit | b_bit, (ax + w * ux, ay + w * uy, az + w * uz)


@inner
def _on_triangle(corners: Array, a: int, b: int, c: int) -> tuple[int, Vector]:
    """The point of a triangle closest to the origin, and the corners (bits 1, 2, 4) of the face, side or corner it lies on."""
    ax, ay, az = _corner(corners, a)
    bx, by, bz = _corner(corners, b)
    cx, cy, cz = _corner(corners, c)
    ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    squared = nx * nx + ny * ny + nz * nz
    # Outside which sides does the origin lie, seen along the normal?
    beyond_c = _turn(ax, ay, az, ux, uy, uz, nx, ny, nz) > 0.0
    beyond_a = _turn(bx, by, bz, cx - bx, cy - by, cz - bz, nx, ny, nz) > 0.0
    beyond_b = _turn(cx, cy, cz, -vx, -vy, -vz, nx, ny, nz) > 0.0
    thin = squared <= _THIN * (ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz)
    if not (thin or beyond_a or beyond_b or beyond_c):
        # Through the normal: exact also where the triangle is narrow.
        w = (nx * ax + ny * ay + nz * az) / squared
        return 7, (w * nx, w * ny, w * nz)
    least, kept, point = math.inf, 0, (0.0, 0.0, 0.0)
    for side in range(3):
        if side == 0:
            here, (x, y, z) = _on_segment(corners, a, b, 1, 2)
        elif side == 1:
            here, (x, y, z) = _on_segment(corners, b, c, 2, 4)
        else:
            here, (x, y, z) = _on_segment(corners, a, c, 1, 4)
        squared = x * x + y * y + z * z
        if squared < least:
            least, kept, point = squared, here, (x, y, z)
    return kept, point


@inner
def _turn(ax: float, ay: float, az: float, ux: float, uy: float, uz: float, nx: float, ny: float, nz: float) -> float:
    """Positive if, seen against n, the origin is to the right of the line through a along u."""
    return nx * (uy * az - uz * ay) + ny * (uz * ax - ux * az) + nz * (ux * ay - uy * ax)
