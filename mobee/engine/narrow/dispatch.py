"""Any two volumes: the function for their kinds."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inlined, inner_with_memory
from mobee.engine.narrow.box_box import box_box
from mobee.engine.narrow.cylinder import sphere_cylinder
from mobee.engine.narrow.difference import FRAME, relative, rounding
from mobee.engine.narrow.features import BOX, CAPSULE, CYLINDER, SPHERE
from mobee.engine.narrow.general import general
from mobee.engine.narrow.gjk import closest
from mobee.engine.narrow.rounded import capsule_capsule, sphere_capsule, sphere_sphere
from mobee.engine.narrow.rounded_box import capsule_box, capsule_box_distance, sphere_box
from mobee.engine.narrow.slots import KIND
from mobee.robot.robot import Array


@inlined
def overlap(P: Array, a: int, b: int, V: Array, out: Array) -> float:
    """How deep two volumes overlap [m]; if they do not, minus a lower bound of their distance.

    P: the slots of a pose; a, b: offsets of two of them; V: the vertices of the convex volumes.  If the depth is positive,
    out[:3] is the unit normal (moving a by depth * normal separates them, and no way is shorter) and out[3:6] the point midway
    between the two deepest points, root frame.
    """
    turned = P[np.uint64(a) + KIND] > P[np.uint64(b) + KIND]
    if turned:
        a, b = b, a
    first, second = P[np.uint64(a) + KIND], P[np.uint64(b) + KIND]
    if second <= CAPSULE:
        if first == CAPSULE:
            depth = capsule_capsule(P, a, b, out)
        else:
            depth = sphere_capsule(P, a, b, out) if second == CAPSULE else sphere_sphere(P, a, b, out)
    elif second == BOX and first <= CAPSULE:
        depth = sphere_box(P, a, b, out) if first == SPHERE else capsule_box(P, a, b, out)
    elif first == BOX and second == BOX:
        depth = box_box(P, a, b, V, out)
    else:
        depth = general(P, a, b, V, out)
    if turned and depth > 0.0:
        out[0], out[1], out[2] = -out[0], -out[1], -out[2]
    return depth


@inner_with_memory
def distance(P: Array, a: int, b: int, V: Array) -> float:
    """How far two volumes are apart [m]: 0 if they overlap; P, a, b and V as for `overlap`."""
    if P[np.uint64(a) + KIND] > P[np.uint64(b) + KIND]:
        a, b = b, a
    i, j = np.uint64(a), np.uint64(b)
    first, second = P[i + KIND], P[j + KIND]
    if first == SPHERE and second == BOX:
        apart = -sphere_box(P, a, b, np.empty(6))
    elif first == SPHERE and second == CYLINDER:
        apart = -sphere_cylinder(P, a, b, np.empty(6))
    elif second <= CAPSULE:
        # A sphere is a capsule without length.
        apart = -capsule_capsule(P, a, b, np.empty(6))
    elif first == CAPSULE and second == BOX:
        apart = capsule_box_distance(P, a, b)
    else:
        frame = np.empty(FRAME)
        relative(P, i, j, frame)
        apart = closest(P, i, j, V, frame, math.inf)[0] - rounding(P, i) - rounding(P, j)
    return max(apart, 0.0)
