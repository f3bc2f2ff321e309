"""Where two volumes touch: the middle of what their features share, seen along the normal, midway between their surfaces."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inner, inner_with_memory
from mobee.engine.narrow.features import feature, most_corners, reach
from mobee.engine.narrow.rounded import closest_parameters
from mobee.engine.narrow.slots import CENTER, ONE, THREE, TWO, ZERO, Offset, Vector, centers_apart, store, vector
from mobee.robot.robot import Array

_NEAR = 1e-9  # m: a corner this close to an edge lies on it


@inner_with_memory
def store_contact(P: Array, i: Offset, j: Offset, V: Array, normal: Vector, depth: float, out: Array) -> None:
    """Write the contact of two volumes of any kind, given the way out of the first and its length."""
    nx, ny, nz = normal
    c = centers_apart(P, i, j)
    # Across the normal: the root axis that is farthest from it, made square to it.
    x = 1.0 if abs(nx) <= abs(ny) and abs(nx) <= abs(nz) else 0.0
    y = 1.0 if x == 0.0 and abs(ny) <= abs(nz) else 0.0
    z = 1.0 - x - y
    along = x * nx + y * ny + z * nz
    x, y, z = x - along * nx, y - along * ny, z - along * nz
    length = math.sqrt(x * x + y * y + z * z)
    t = x / length, y / length, z / length
    u = ny * t[2] - nz * t[1], nz * t[0] - nx * t[2], nx * t[1] - ny * t[0]
    ma, mb = most_corners(P, i), most_corners(P, j)
    room = (ma + mb) * TWO
    memory = np.empty(room * THREE)
    one, two, spare = memory[:room], memory[room : room * TWO], memory[room * TWO :]
    ka = feature(P, i, V, (-nx, -ny, -nz), t, u, c, one)
    kb = feature(P, j, V, normal, t, u, (0.0, 0.0, 0.0), two)
    p, q = _shared(one, ka, two, kb, spare)
    height = reach(P, j, V, normal) - depth / 2.0
    bx, by, bz = vector(P, j + CENTER)
    store(
        out,
        normal,
        (
            bx + p * t[0] + q * u[0] + height * nx,
            by + p * t[1] + q * u[1] + height * ny,
            bz + p * t[2] + q * u[2] + height * nz,
        ),
    )


@inner
def _shared(one: Array, ka: Offset, two: Array, kb: Offset, spare: Array) -> tuple[float, float]:
    """The middle of what two convex features of a plane (corners x, y, in order) share."""
    if ka == ONE and kb == ONE:
        return (one[0] + two[0]) / 2.0, (one[1] + two[1]) / 2.0
    if ka == TWO and kb == TWO:
        return _crossing(one, two)
    # The one with more corners is the window that the other is seen through.
    if kb < ka:
        one, two, ka, kb = two, one, kb, ka
    return (one[0], one[1]) if ka == ONE else _clipped(one, ka, two, kb, spare)


@inner
def _crossing(one: Array, two: Array) -> tuple[float, float]:
    x, y, ux, uy = (one[0] + one[2]) / 2.0, (one[1] + one[3]) / 2.0, (one[2] - one[0]) / 2.0, (one[3] - one[1]) / 2.0
    p, q, vx, vy = (two[0] + two[2]) / 2.0, (two[1] + two[3]) / 2.0, (two[2] - two[0]) / 2.0, (two[3] - two[1]) / 2.0
    s, t = closest_parameters(x - p, y - q, 0.0, ux, uy, 0.0, vx, vy, 0.0)
    return (x + s * ux + p + t * vx) / 2.0, (y + s * uy + q + t * vy) / 2.0


@inner
def _clipped(one: Array, count: Offset, window: Array, sides: Offset, spare: Array) -> tuple[float, float]:
    """The middle of the outline of a polygon or segment cut by each side of another polygon (Sutherland and Hodgman)."""
    area = 0.0
    for k in range(ONE, sides - ONE):
        ax, ay = window[k * TWO] - window[0], window[k * TWO + ONE] - window[1]
        area += ax * (window[k * TWO + THREE] - window[1]) - ay * (window[k * TWO + TWO] - window[0])
    turn = 1.0 if area >= 0.0 else -1.0
    for k in range(sides):
        m = k + ONE if k + ONE < sides else ZERO
        x, y = window[k * TWO], window[k * TWO + ONE]
        dx, dy = window[m * TWO] - x, window[m * TWO + ONE] - y
        length = math.sqrt(dx * dx + dy * dy)
        if length > _NEAR:
            left = _cut(one, count, x, y, -turn * dy / length, turn * dx / length, spare)
            if left == ZERO:
                break
            count = left
            for i in range(count * TWO):
                one[i] = spare[i]
    return _middle(one, count)


@inner
def _cut(points: Array, count: Offset, x: float, y: float, nx: float, ny: float, out: Array) -> Offset:
    """Write the part of a convex polygon that is not beyond the line through (x, y) with the inward normal n; how many corners.

    Corners that `out` has no room for are left out: a polygon that is convex only within rounding may be cut more than twice.
    """
    kept, last, room = ZERO, (count - ONE) * TWO, np.uint64(len(out)) // TWO
    px, py = points[last], points[last + ONE]
    before = (px - x) * nx + (py - y) * ny
    for k in range(count):
        qx, qy = points[k * TWO], points[k * TWO + ONE]
        here = (qx - x) * nx + (qy - y) * ny
        if kept < room and ((here < -_NEAR and before > _NEAR) or (here > _NEAR and before < -_NEAR)):
            weight = before / (before - here)
            out[kept * TWO], out[kept * TWO + ONE] = px + weight * (qx - px), py + weight * (qy - py)
            kept += ONE
        if kept < room and here >= -_NEAR:
            out[kept * TWO], out[kept * TWO + ONE] = qx, qy
            kept += ONE
        px, py, before = qx, qy, here
    return kept


@inner
def _middle(points: Array, count: Offset) -> tuple[float, float]:
    """The mean of the outline: of a polygon, however thin, of a segment or of a point."""
    total, x, y, last = 0.0, 0.0, 0.0, (count - ONE) * TWO
    px, py = points[last], points[last + ONE]
    for k in range(count):
        qx, qy = points[k * TWO], points[k * TWO + ONE]
        length = math.sqrt((qx - px) * (qx - px) + (qy - py) * (qy - py))
        total, x, y = total + length, x + length * (px + qx) / 2.0, y + length * (py + qy) / 2.0
        px, py = qx, qy
    return (px, py) if total <= _NEAR else (x / total, y / total)
