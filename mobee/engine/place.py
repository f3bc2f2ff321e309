"""Shapes and clusters of shapes, placed in one pose."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inner
from mobee.engine.kinematics import LINK
from mobee.engine.layout import (
    BOUND,
    BOX,
    CAPSULE,
    CENTER,
    CORE,
    CYLINDER,
    HALF,
    INVERSE,
    KIND,
    LENGTH,
    RADIUS,
    ROTATION,
    ROW,
    ROW_BOUND,
    ROW_HALF,
    ROW_KIND,
    ROW_POSITION,
    ROW_ROTATION,
    SLOT,
    SPHERE,
)
from mobee.engine.pack import CLUSTERS, F_ROW, I_LINK, I_START, SHAPES, Flags, UInts
from mobee.robot.robot import Array

_SLOT, _ROW, _LINK = np.uint64(SLOT), np.uint64(ROW), np.uint64(LINK)
_1, _2, _3, _4, _5, _6 = (np.uint64(k) for k in range(1, 7))
_7, _8, _9, _10, _11 = (np.uint64(k) for k in range(7, 12))
_CENTER, _ROTATION, _HALF, _CORE, _RADIUS, _BOUND, _KIND = (np.uint64(k) for k in (CENTER, ROTATION, HALF, CORE, RADIUS, BOUND, KIND))
_LENGTH, _INVERSE = np.uint64(LENGTH), np.uint64(INVERSE)
_ROW_KIND, _ROW_POSITION, _ROW_ROTATION, _ROW_HALF, _ROW_BOUND = (
    np.uint64(k) for k in (ROW_KIND, ROW_POSITION, ROW_ROTATION, ROW_HALF, ROW_BOUND)
)


@inner
def _turn(links: Array, frame: np.uint64, floats: Array, f: np.uint64, slots: Array, o: np.uint64) -> None:
    """Fill one column of a rotation."""
    d, e, g = floats[f], floats[f + _3], floats[f + _6]
    slots[o] = links[frame] * d + links[frame + _1] * e + links[frame + _2] * g
    slots[o + _3] = links[frame + _4] * d + links[frame + _5] * e + links[frame + _6] * g
    slots[o + _6] = links[frame + _8] * d + links[frame + _9] * e + links[frame + _10] * g


@inner
def place_shapes(integers: UInts, floats: Array, links: Array, moved: Flags, slots: Array, x: Array, y: Array, z: Array) -> None:
    """Fill what changes with the pose in every shape's slot, and the centres once more as columns x, y, z (S,).

    Where `moved` (L,) says that the link has not, all stays as it is.
    """
    link, row = integers[I_LINK], integers[F_ROW]
    for i in range(integers[SHAPES]):
        if not moved[integers[link + i]]:
            continue
        at, frame, r = i * _SLOT, integers[link + i] * _LINK, row + i * _ROW
        p = r + _ROW_POSITION
        a, b, c = floats[p], floats[p + _1], floats[p + _2]
        x[i] = links[frame] * a + links[frame + _1] * b + links[frame + _2] * c + links[frame + _3]
        y[i] = links[frame + _4] * a + links[frame + _5] * b + links[frame + _6] * c + links[frame + _7]
        z[i] = links[frame + _8] * a + links[frame + _9] * b + links[frame + _10] * c + links[frame + _11]
        slots[at], slots[at + _1], slots[at + _2] = x[i], y[i], z[i]
        kind = floats[r + _ROW_KIND]
        if kind == SPHERE:
            continue
        f = r + _ROW_ROTATION
        for column in range(_3):
            _turn(links, frame, floats, f + column, slots, at + _ROTATION + column)
        if kind == CAPSULE or kind == CYLINDER:
            half = floats[r + _ROW_HALF + _1]
            d, e, g = half * floats[f + _2], half * floats[f + _5], half * floats[f + _8]
            slots[at + _CORE] = links[frame] * d + links[frame + _1] * e + links[frame + _2] * g
            slots[at + _CORE + _1] = links[frame + _4] * d + links[frame + _5] * e + links[frame + _6] * g
            slots[at + _CORE + _2] = links[frame + _8] * d + links[frame + _9] * e + links[frame + _10] * g


@inner
def settle_slots(rows: Array, start: np.uint64, first: np.uint64, count: np.uint64, slots: Array) -> None:
    """Fill slots first .. first + count - 1 from rows that begin at `start`: all of a free object, what never changes of a shape."""
    for i in range(count):
        at, r = (first + i) * _SLOT, start + i * _ROW
        for k in range(_3):
            slots[at + _CENTER + k] = rows[r + _ROW_POSITION + k]
            slots[at + _HALF + k] = rows[r + _ROW_HALF + k]
        for k in range(_9):
            slots[at + _ROTATION + k] = rows[r + _ROW_ROTATION + k]
        kind = rows[r + _ROW_KIND]
        long = kind == CAPSULE or kind == CYLINDER
        for k in range(_3):
            slots[at + _CORE + k] = rows[r + _ROW_ROTATION + _3 * k + _2] * rows[r + _ROW_HALF + _1] if long else 0.0
        slots[at + _RADIUS] = rows[r + _ROW_HALF] if kind < BOX else 0.0
        slots[at + _BOUND] = rows[r + _ROW_BOUND]
        slots[at + _KIND] = kind
        squared = rows[r + _ROW_HALF + _1] ** 2 if long else 0.0
        slots[at + _LENGTH], slots[at + _INVERSE] = squared, 1.0 / squared if squared > 0.0 else 0.0


@inner
def bound_clusters(integers: UInts, slots: Array, x: Array, y: Array, z: Array, balls: Array) -> None:
    """Fill for every cluster a ball that holds it, four floats: the mean of its shapes' centres, and the radius."""
    start = integers[I_START]
    for c in range(integers[CLUSTERS]):
        low, high = integers[start + c], integers[start + c + _1]
        u, v, w = 0.0, 0.0, 0.0
        for i in range(low, high):
            u, v, w = u + x[i], v + y[i], w + z[i]
        share = 1.0 / float(high - low)
        u, v, w = u * share, v * share, w * share
        radius = 0.0
        for i in range(low, high):
            d, e, f = x[i] - u, y[i] - v, z[i] - w
            radius = max(radius, math.sqrt(d * d + e * e + f * f) + slots[i * _SLOT + _BOUND])
        o = c * _4
        balls[o], balls[o + _1], balls[o + _2], balls[o + _3] = u, v, w, radius
