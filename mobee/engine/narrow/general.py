"""Every pair with a cylinder or a convex hull: closed form, else iterations over the difference of their cores."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine import layout
from mobee.engine.compiled import inner, inner_with_memory
from mobee.engine.narrow.cylinder import sphere_cylinder
from mobee.engine.narrow.difference import FRAME, farthest, relative, rounding
from mobee.engine.narrow.epa import way_out
from mobee.engine.narrow.features import CYLINDER, SPHERE
from mobee.engine.narrow.gjk import closest
from mobee.engine.narrow.middle import store_contact
from mobee.engine.narrow.slots import KIND, TIE, TOUCHING, Offset, Vector, centers_apart, out_of
from mobee.robot.robot import Array

_BOUND = np.uint64(layout.BOUND)


@inner_with_memory
def general(P: Array, a: int, b: int, V: Array, out: Array) -> float:
    """See `overlap`."""
    i, j = np.uint64(a), np.uint64(b)
    if P[i + KIND] == SPHERE and P[j + KIND] == CYLINDER:
        return sphere_cylinder(P, a, b, out)
    x, y, z = centers_apart(P, i, j)
    apart = math.sqrt(x * x + y * y + z * z) - P[i + _BOUND] - P[j + _BOUND]
    if apart >= 0.0:
        return -apart
    frame = np.empty(FRAME)
    relative(P, i, j, frame)
    round_off = rounding(P, i) + rounding(P, j)
    distance, (x, y, z) = closest(P, i, j, V, frame, round_off)
    if distance >= round_off and distance > 0.0:
        return round_off - distance
    if distance > TOUCHING:
        depth, normal = -distance, (-x / distance, -y / distance, -z / distance)
    else:
        depth, normal = _natural(P, i, j, V, frame)
        depth, normal = way_out(P, i, j, V, frame, depth, normal)
    depth += round_off
    if depth > 0.0:
        store_contact(P, i, j, V, out_of(P, i, normal[0], normal[1], normal[2]), depth, out)
    return depth


@inner
def _natural(P: Array, i: Offset, j: Offset, V: Array, frame: Array) -> tuple[float, Vector]:
    """The shortest way out along the axes of either volume, across two axes, or straight away from the axis of either."""
    depth, normal = math.inf, (0.0, 0.0, 1.0)
    for which in range(9):
        if which < 3:
            x, y, z = (1.0 if which == 2 else 0.0), (1.0 if which == 0 else 0.0), (1.0 if which == 1 else 0.0)
        elif which < 6:
            column = 3 + (which + 2) % 3
            x, y, z = frame[column], frame[column + 3], frame[column + 6]
        elif which == 6:
            x, y, z = frame[0], frame[1], 0.0
        else:
            x, y, z = frame[5], frame[8], frame[11]
            if which == 7:
                along = frame[0] * x + frame[1] * y + frame[2] * z
                x, y, z = frame[0] - along * x, frame[1] - along * y, frame[2] - along * z
            else:
                x, y, z = -y, x, 0.0
        length = math.sqrt(x * x + y * y + z * z)
        if length <= TIE:
            continue
        for turn in (1.0, -1.0):
            nx, ny, nz = turn * x / length, turn * y / length, turn * z / length
            px, py, pz = farthest(P, i, j, V, frame, nx, ny, nz)
            reach = nx * px + ny * py + nz * pz
            if reach < depth - TIE:
                depth, normal = reach, (nx, ny, nz)
    return depth, normal
