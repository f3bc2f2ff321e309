"""The shortest way out of a Minkowski difference that holds the origin: an expanding polytope inside it.

Each step takes the face of the polytope that is closest to the origin (below it, where the polytope does not yet hold the
origin) and adds the farthest point along its normal, until there is none.  How far the difference reaches along any direction
tried is a true way out, whatever rounding did to the polytope, and the shortest of these is the answer.
"""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inner
from mobee.engine.narrow.difference import farthest
from mobee.engine.narrow.slots import TIE, Offset, Vector
from mobee.robot.robot import Array, Ints

_STEPS = 124
_CORNERS = _STEPS + 4
_FACES = 2 * _CORNERS
_EXACT = 1e-12  # m, for volumes of up to a metre: the bounds have met


@inner
def way_out(P: Array, i: Offset, j: Offset, V: Array, frame: Array, shortest: float, way: Vector) -> tuple[float, Vector]:
    """The least reach of the difference b - a over all directions [m], and that direction, in the first's axes.

    A `way` that is known already, with its reach, stays unless another is shorter by more than TIE.
    """
    corners, planes, faces, edges = np.empty(3 * _CORNERS), np.empty(4 * _FACES), np.empty(3 * _FACES, np.int64), np.empty(3 * _FACES, np.int64)
    size, flat = _tetrahedron(P, i, j, V, frame, corners)
    if size == 0.0:
        reach = _reach(P, i, j, V, frame, flat)
        return (reach, flat) if reach < shortest - TIE else (shortest, way)
    exact = _EXACT * max(size, 1.0)
    count, used = 4, 4
    for face in range(4):
        a, b, c = (0, 1, 2) if face == 0 else (1, 0, 3) if face == 1 else (2, 1, 3) if face == 2 else (0, 2, 3)
        _face(corners, planes, faces, face, a, b, c)
    best, found = math.inf, way
    for _ in range(_STEPS):
        face = _least(planes, used)
        x, y, z, low = planes[4 * face], planes[4 * face + 1], planes[4 * face + 2], planes[4 * face + 3]
        px, py, pz = farthest(P, i, j, V, frame, x, y, z)
        reach = x * px + y * py + z * pz
        if reach < best:
            best, found = reach, (x, y, z)
        if best <= 0.0 or best - low <= exact or shortest - TIE <= low or reach - low <= exact:
            break
        corners[3 * count], corners[3 * count + 1], corners[3 * count + 2] = px, py, pz
        used = _expand(corners, planes, faces, edges, used, count, exact)
        count += 1
        if used > _FACES - 8:
            break
    return (best, found) if best < shortest - TIE else (shortest, way)


@inner
def _reach(P: Array, i: Offset, j: Offset, V: Array, frame: Array, n: Vector) -> float:
    x, y, z = farthest(P, i, j, V, frame, n[0], n[1], n[2])
    return n[0] * x + n[1] * y + n[2] * z


@inner
def _least(planes: Array, used: int) -> int:
    """The face that is closest to the origin; of equals the oldest."""
    face, least = 0, math.inf
    for k in range(np.uint64(used)):
        low = planes[k * np.uint64(4) + np.uint64(3)]
        if low < least - 0.01 * _EXACT:
            face, least = np.int64(k), low
    return face


@inner
def _face(corners: Array, planes: Array, faces: Ints, at: int, a: int, b: int, c: int) -> None:
    """Write the face a, b, c (seen from outside against the clock) and its plane; one without area is never the closest."""
    faces[3 * at], faces[3 * at + 1], faces[3 * at + 2] = a, b, c
    ax, ay, az = corners[3 * a], corners[3 * a + 1], corners[3 * a + 2]
    ux, uy, uz = corners[3 * b] - ax, corners[3 * b + 1] - ay, corners[3 * b + 2] - az
    vx, vy, vz = corners[3 * c] - ax, corners[3 * c + 1] - ay, corners[3 * c + 2] - az
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = math.sqrt(x * x + y * y + z * z)
    if length > 1e-14 * math.sqrt((ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz)) and length > 0.0:
        x, y, z = x / length, y / length, z / length
        low = x * ax + y * ay + z * az
    else:
        x, y, z, low = 0.0, 0.0, 0.0, math.inf
    planes[4 * at], planes[4 * at + 1], planes[4 * at + 2], planes[4 * at + 3] = x, y, z, low


@inner
def _expand(corners: Array, planes: Array, faces: Ints, edges: Ints, used: int, new: int, exact: float) -> int:
    """Take away the faces that see the new corner, and span new ones from it to the edge of the hole; how many faces then."""
    x, y, z = corners[3 * new], corners[3 * new + 1], corners[3 * new + 2]
    open_edges = 0
    face = 0
    while face < used:
        k = np.uint64(4 * face)
        if planes[k] * x + planes[k + np.uint64(1)] * y + planes[k + np.uint64(2)] * z - planes[k + np.uint64(3)] > 0.1 * exact:
            for side in range(3):
                a, b = faces[3 * face + side], faces[3 * face + (side + 1) % 3]
                open_edges = _toggle(edges, open_edges, a, b)
            used -= 1
            for m in range(3):
                faces[3 * face + m] = faces[3 * used + m]
            for m in range(4):
                planes[4 * face + m] = planes[4 * used + m]
        else:
            face += 1
    for edge in range(open_edges):
        if used < _FACES:
            _face(corners, planes, faces, used, edges[2 * edge], edges[2 * edge + 1], new)
            used += 1
    return used


@inner
def _toggle(edges: Ints, count: int, a: int, b: int) -> int:
    """Add an edge, or take it away if the other face along it is taken away too."""
    for k in range(count):
        if edges[2 * k] == b and edges[2 * k + 1] == a:
            edges[2 * k], edges[2 * k + 1] = edges[2 * count - 2], edges[2 * count - 1]
            return count - 1
    if 2 * count + 2 <= len(edges):
        edges[2 * count], edges[2 * count + 1] = a, b
        return count + 1
    return count


@inner
def _tetrahedron(P: Array, i: Offset, j: Offset, V: Array, frame: Array, corners: Array) -> tuple[float, Vector]:
    """Write four corners of the difference, 0 1 2 against the clock seen from outside; its size [m].

    Size 0: the difference is flat, and the vector is its normal.
    """
    size, axis = -1.0, 0
    for k in range(3):
        n = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
        width = _reach(P, i, j, V, frame, n) + _reach(P, i, j, V, frame, (-n[0], -n[1], -n[2]))
        if width > size:
            size, axis = width, k
    x, y, z = (1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)
    _put(P, i, j, V, frame, corners, 0, (-x, -y, -z))
    _put(P, i, j, V, frame, corners, 1, (x, y, z))
    ux, uy, uz = corners[3] - corners[0], corners[4] - corners[1], corners[5] - corners[2]
    length = math.sqrt(ux * ux + uy * uy + uz * uz)
    if length <= TIE:
        return 0.0, (0.0, 0.0, 1.0)
    ux, uy, uz = ux / length, uy / length, uz / length
    # Two directions square to the first edge.
    least = min(abs(ux), abs(uy), abs(uz))
    x, y, z = (1.0, 0.0, 0.0) if abs(ux) == least else (0.0, 1.0, 0.0) if abs(uy) == least else (0.0, 0.0, 1.0)
    x, y, z = uy * z - uz * y, uz * x - ux * z, ux * y - uy * x
    length = math.sqrt(x * x + y * y + z * z)
    first = x / length, y / length, z / length
    second = uy * first[2] - uz * first[1], uz * first[0] - ux * first[2], ux * first[1] - uy * first[0]
    far = 0.0
    for k in range(4):
        n = first if k < 2 else second
        turn = 1.0 if k % 2 == 0 else -1.0
        _put(P, i, j, V, frame, corners, 3, (turn * n[0], turn * n[1], turn * n[2]))
        x, y, z = corners[9] - corners[0], corners[10] - corners[1], corners[11] - corners[2]
        x, y, z = uy * z - uz * y, uz * x - ux * z, ux * y - uy * x
        off = math.sqrt(x * x + y * y + z * z)
        if off > far + TIE:
            far = off
            for m in range(3):
                corners[6 + m] = corners[9 + m]
    if far == 0.0:
        return 0.0, first
    x, y, z = corners[6] - corners[0], corners[7] - corners[1], corners[8] - corners[2]
    x, y, z = uy * z - uz * y, uz * x - ux * z, ux * y - uy * x
    length = math.sqrt(x * x + y * y + z * z)
    x, y, z = x / length, y / length, z / length
    low = x * corners[0] + y * corners[1] + z * corners[2]
    above, below = _reach(P, i, j, V, frame, (x, y, z)) - low, _reach(P, i, j, V, frame, (-x, -y, -z)) + low
    if above + below <= TIE:
        return 0.0, ((x, y, z) if above + low <= below - low else (-x, -y, -z))
    if above > below:
        # The fourth corner belongs behind the face 0 1 2.
        for m in range(3):
            corners[3 + m], corners[6 + m] = corners[6 + m], corners[3 + m]
        x, y, z = -x, -y, -z
    _put(P, i, j, V, frame, corners, 3, (-x, -y, -z))
    return size, (x, y, z)


@inner
def _put(P: Array, i: Offset, j: Offset, V: Array, frame: Array, corners: Array, at: int, n: Vector) -> None:
    corners[3 * at], corners[3 * at + 1], corners[3 * at + 2] = farthest(P, i, j, V, frame, n[0], n[1], n[2])
