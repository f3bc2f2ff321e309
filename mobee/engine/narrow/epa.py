"""The shortest way out of a Minkowski difference that holds the origin: an expanding polytope inside it.

Each step takes the face of the polytope that is closest to the origin (below it, where the polytope does not yet hold the
origin) and adds the farthest point along its normal, until there is none.  How far the difference reaches along any direction
tried is a true way out, whatever rounding did to the polytope, and the shortest of these is the answer.  It is exact for
polytopes.  With cylinders it is better than 1e-9 m, but where ways out all round an axis are nearly as short and the steps end
first: there it may be too long by 1e-6 of the size.
"""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inner, inner_with_memory
from mobee.engine.narrow.difference import farthest
from mobee.engine.narrow.polish import polish
from mobee.engine.narrow.slots import FOUR, ONE, SIX, THREE, TIE, TWO, ZERO, Offset, Vector, vector
from mobee.robot.robot import Array

Indices = np.ndarray[tuple[int], np.dtype[np.uint64]]

_CORNERS = 128
_FACES = 2 * _CORNERS
_FULL = np.uint64(_FACES - 8)  # which is sooner than there are too many corners
_EXACT = 1e-12  # m, for volumes of up to a metre: the bounds have met


@inner_with_memory
def way_out(P: Array, i: Offset, j: Offset, V: Array, frame: Array, shortest: float, way: Vector) -> tuple[float, Vector]:
    """The least reach of the difference b - a over all directions [m], and that direction, in the first's axes.

    A `way` that is known already, with its reach, stays unless another is shorter by more than TIE.
    """
    corners, planes = np.empty(3 * _CORNERS), np.empty(4 * _FACES)
    faces, edges = np.empty(3 * _FACES, np.uint64), np.empty(6 * _FACES, np.uint64)
    size, (x, y, z) = _tetrahedron(P, i, j, V, frame, corners)
    exact = _EXACT * max(size, 1.0)
    used = ZERO
    for face in range(FOUR):
        a, b = face % THREE, (face + ONE) % THREE
        # 0 1 2, then 2 1 3, 0 2 3 and 1 0 3.
        a, b, c = (ZERO, ONE, TWO) if face == ZERO else (b, a, THREE)
        used = _add_face(corners, planes, faces, used, a, b, c)
    best, found = math.inf, way
    low = -math.inf
    for count in range(FOUR, np.uint64(_CORNERS)):
        if size > 0.0:
            face = _least(planes, used)
            x, y, z = vector(planes, face * FOUR)
            low = planes[face * FOUR + THREE]
        p = farthest(P, i, j, V, frame, x, y, z)
        reach = x * p[0] + y * p[1] + z * p[2]
        if reach < best:
            best, found = reach, (x, y, z)
        if size == 0.0 or best <= 0.0 or min(best, shortest - TIE, reach) - low <= exact:
            break
        if used > _FULL:
            best, found = polish(P, i, j, V, frame, min(best, shortest), found if best < shortest - TIE else way)
            break
        corners[count * THREE], corners[count * THREE + ONE], corners[count * THREE + TWO] = p
        used = _expand(corners, planes, faces, edges, used, count, exact)
    return (best, found) if best < shortest - TIE else (shortest, way)


@inner
def _least(planes: Array, used: Offset) -> Offset:
    """The face that is closest to the origin."""
    face, least = ZERO, math.inf
    for k in range(used):
        low = planes[k * FOUR + THREE]
        if low < least - 0.01 * _EXACT:
            face, least = k, low
    return face


@inner
def _add_face(corners: Array, planes: Array, faces: Indices, used: Offset, a: Offset, b: Offset, c: Offset) -> Offset:
    """Add the face a, b, c (against the clock, seen from outside); one without area is never the closest.  How many then."""
    ax, ay, az = vector(corners, a * THREE)
    bx, by, bz = vector(corners, b * THREE)
    cx, cy, cz = vector(corners, c * THREE)
    ux, uy, uz, vx, vy, vz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    squared, low = x * x + y * y + z * z, math.inf
    if squared > 1e-28 * (ux * ux + uy * uy + uz * uz) * (vx * vx + vy * vy + vz * vz):
        length = math.sqrt(squared)
        x, y, z = x / length, y / length, z / length
        low = x * ax + y * ay + z * az
    at, plane = used * THREE, used * FOUR
    faces[at], faces[at + ONE], faces[at + TWO] = a, b, c
    planes[plane], planes[plane + ONE], planes[plane + TWO], planes[plane + THREE] = x, y, z, low
    return used + ONE


@inner
def _expand(corners: Array, planes: Array, faces: Indices, edges: Indices, used: Offset, new: Offset, exact: float) -> Offset:
    """Take away the faces that see the new corner, and span new ones from it to the edge of the hole; how many faces then."""
    px, py, pz = vector(corners, new * THREE)
    rim, face = ZERO, ZERO
    while face < used:
        x, y, z = vector(planes, face * FOUR)
        if x * px + y * py + z * pz - planes[face * FOUR + THREE] > 0.1 * exact:
            at = face * THREE
            for side in range(THREE):
                rim = _toggle(edges, rim, faces[at + side], faces[at + (side + ONE if side < TWO else ZERO)])
            used -= ONE
            for k in range(THREE):
                faces[at + k] = faces[used * THREE + k]
            for k in range(FOUR):
                planes[face * FOUR + k] = planes[used * FOUR + k]
        else:
            face += ONE
    for edge in range(min(rim, np.uint64(_FACES) - used)):
        used = _add_face(corners, planes, faces, used, edges[edge * TWO], edges[edge * TWO + ONE], new)
    return used


@inner
def _toggle(edges: Indices, count: Offset, a: Offset, b: Offset) -> Offset:
    """Add an edge, or take it away if the other face along it is taken away too; how many then."""
    for k in range(count):
        if edges[k * TWO] == b and edges[k * TWO + ONE] == a:
            last = (count - ONE) * TWO
            edges[k * TWO], edges[k * TWO + ONE] = edges[last], edges[last + ONE]
            return count - ONE
    edges[count * TWO], edges[count * TWO + ONE] = a, b
    return count + ONE


@inner
def _tetrahedron(P: Array, i: Offset, j: Offset, V: Array, frame: Array, corners: Array) -> tuple[float, Vector]:
    """Write four corners of the difference, 0 1 2 against the clock seen from outside; how far the last is from the others [m].

    0: the difference is flat, and the vector is its normal.
    """
    one, two, three = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    px = py = pz = ux = uy = uz = width = turned = 0.0
    for count in range(FOUR):
        # Each the farthest from the first along the directions square to those that there are.
        width = -1.0 if count == ZERO else TIE
        x, y, z = px, py, pz
        for which in range(SIX if count == ONE else FOUR if count == TWO else TWO):
            n = one if which < TWO else two if which < FOUR else three
            turn = 1.0 if which & ONE == ZERO else -1.0
            qx, qy, qz = farthest(P, i, j, V, frame, turn * n[0], turn * n[1], turn * n[2])
            off = turn * (n[0] * (qx - px) + n[1] * (qy - py) + n[2] * (qz - pz))
            if off > width or count == ZERO:
                width, turned, x, y, z = off, turn, qx, qy, qz
        if width == TIE:
            return 0.0, one
        corners[count * THREE], corners[count * THREE + ONE], corners[count * THREE + TWO] = x, y, z
        if count == ZERO:
            px, py, pz = x, y, z
        elif count == ONE:
            ux, uy, uz = x - px, y - py, z - pz
            ax, ay, az = abs(ux), abs(uy), abs(uz)
            if ax <= ay and ax <= az:
                one = _unit(0.0, -uz, uy)
            elif ay <= az:
                one = _unit(uz, 0.0, -ux)
            else:
                one = _unit(-uy, ux, 0.0)
            two = _unit(uy * one[2] - uz * one[1], uz * one[0] - ux * one[2], ux * one[1] - uy * one[0])
        elif count == TWO:
            vx, vy, vz = x - px, y - py, z - pz
            one = _unit(uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx)
    if turned > 0.0:
        # The last is in front of 0 1 2: turn those round.
        for k in range(THREE):
            corners[k], corners[k + THREE] = corners[k + THREE], corners[k]
    return width, one


@inner
def _unit(x: float, y: float, z: float) -> Vector:
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length
