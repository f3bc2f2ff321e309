"""Any two volumes: the function for their kinds."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inner
from mobee.engine.narrow.box_box import box_box
from mobee.engine.narrow.difference import FRAME, relative, rounding
from mobee.engine.narrow.features import BOX, CAPSULE, CONVEX, SPHERE
from mobee.engine.narrow.general import general
from mobee.engine.narrow.gjk import closest
from mobee.engine.narrow.rounded import capsule_capsule, sphere_capsule, sphere_sphere
from mobee.engine.narrow.rounded_box import capsule_box, capsule_box_distance, sphere_box
from mobee.engine.narrow.slots import KIND, turn_round
from mobee.robot.robot import Array


@inner
def overlap(P: Array, a: int, b: int, V: Array, out: Array) -> float:
    """How deep two volumes overlap [m]; if they do not, minus a lower bound of their distance.

    P: the slots of a pose; a, b: offsets of two of them; V: the vertices of the convex volumes.  If the depth is positive,
    out[:3] is the unit normal (moving a by depth * normal separates them, and no way is shorter) and out[3:6] the point midway
    between the two deepest points, root frame.
    """
    if P[np.uint64(a) + KIND] <= P[np.uint64(b) + KIND]:
        return _ordered(P, a, b, V, out)
    depth = _ordered(P, b, a, V, out)
    if depth > 0.0:
        turn_round(out)
    return depth


@inner
def _ordered(P: Array, a: int, b: int, V: Array, out: Array) -> float:
    """The first of a kind not after the second's."""
    first, second = P[np.uint64(a) + KIND], P[np.uint64(b) + KIND]
    if second == SPHERE:
        return sphere_sphere(P, a, b, V, out)
    if second == CAPSULE:
        return sphere_capsule(P, a, b, V, out) if first == SPHERE else capsule_capsule(P, a, b, V, out)
    if second == BOX:
        if first == SPHERE:
            return sphere_box(P, a, b, V, out)
        if first == CAPSULE:
            return capsule_box(P, a, b, V, out)
        if first == BOX:
            return box_box(P, a, b, V, out)
    return general(P, a, b, V, out)


@inner
def distance(P: Array, a: int, b: int, V: Array) -> float:
    """How far two volumes are apart [m]: 0 if they overlap; P, a, b and V as for `overlap`."""
    if P[np.uint64(a) + KIND] > P[np.uint64(b) + KIND]:
        a, b = b, a
    i, j = np.uint64(a), np.uint64(b)
    first, second = P[i + KIND], P[j + KIND]
    if first == CAPSULE and second == BOX:
        return capsule_box_distance(P, a, b)
    if second <= CAPSULE or first == SPHERE and second != CONVEX:
        return max(-_ordered(P, a, b, V, np.empty(6)), 0.0)
    frame = np.empty(FRAME)
    relative(P, i, j, frame)
    return max(closest(P, i, j, V, frame, math.inf)[0] - rounding(P, i) - rounding(P, j), 0.0)
