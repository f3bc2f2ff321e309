"""Which pairs may touch: clusters whose balls overlap, then shapes whose enclosing spheres do.

Distances are compared in columns without branches, so that the compiler can use vector instructions; only rows with a hit are
looked through.
"""

from __future__ import annotations

import numpy as np

from mobee.engine.compiled import inlined, inner
from mobee.engine.layout import BOUND, SLOT
from mobee.engine.pack import CLUSTER_PAIRS, CLUSTERS, F_REACH, I_PAIR, I_START, I_WORLD, SHAPES, UInts
from mobee.engine.scene import CELLS, CORNER, COUNT, LARGE, PER_METRE, W_COLUMNS, W_START, WIDEST
from mobee.robot.robot import Array

_0, _1, _2, _3, _4 = (np.uint64(k) for k in range(5))
_SLOT, _BOUND = np.uint64(SLOT), np.uint64(BOUND)


@inner
def own_pairs(
    integers: UInts, floats: Array, slots: Array, x: Array, y: Array, z: Array, balls: Array, first: UInts, second: UInts
) -> np.uint64:
    """List the slots' offsets of the robot's own pairs that may touch; returns how many."""
    found = _0
    reach, start, pair, shapes = integers[F_REACH], integers[I_START], integers[I_PAIR], integers[SHAPES]
    for p in range(integers[CLUSTER_PAIRS]):
        a, b = integers[pair + _2 * p], integers[pair + _2 * p + _1]
        u, v, w = balls[a * _4] - balls[b * _4], balls[a * _4 + _1] - balls[b * _4 + _1], balls[a * _4 + _2] - balls[b * _4 + _2]
        near = balls[a * _4 + _3] + balls[b * _4 + _3]
        if a != b and u * u + v * v + w * w >= near * near:
            continue
        low, high = integers[start + b], integers[start + b + _1]
        u, v, w, radius = balls[b * _4], balls[b * _4 + _1], balls[b * _4 + _2], balls[b * _4 + _3]
        for i in range(integers[start + a], integers[start + a + _1]):
            xi, yi, zi = x[i], y[i], z[i]
            near = radius + slots[i * _SLOT + _BOUND]
            if a != b and (xi - u) * (xi - u) + (yi - v) * (yi - v) + (zi - w) * (zi - w) >= near * near:
                continue
            row = reach + i * shapes
            begin = i + _1 if a == b else low
            hits = 0
            for j in range(begin, high):
                d, e, f = xi - x[j], yi - y[j], zi - z[j]
                hits += 1 if d * d + e * e + f * f < floats[row + j] else 0
            if hits == 0:
                continue
            for j in range(begin, high):  # written in any case and kept or not: guessing a branch wrong costs more
                d, e, f = xi - x[j], yi - y[j], zi - z[j]
                first[found], second[found] = i * _SLOT, j * _SLOT
                found += _1 if d * d + e * e + f * f < floats[row + j] else _0
    return found


@inner
def world_pairs(
    integers: UInts,
    slots: Array,
    balls: Array,
    world: UInts,
    places: Array,
    near: Array,
    near_slot: UInts,
    first: UInts,
    second: UInts,
    found: np.uint64,
) -> np.uint64:
    """Add the pairs of a shape and a free object that may touch; returns how many pairs there are now.

    `near` (4 N,) and `near_slot` (N,) are for the objects near one cluster, gathered once for all of its shapes.
    """
    if world[COUNT] == _0:
        return found
    start, meets = integers[I_START], integers[I_WORLD]
    for c in range(integers[CLUSTERS]):
        count = _near_cluster(balls, c, world, places, integers[SHAPES], near, near_slot)
        if count == _0:
            continue
        for i in range(integers[start + c], integers[start + c + _1]):
            if integers[meets + i] == _0:
                continue
            at = i * _SLOT
            xi, yi, zi, ri = slots[at], slots[at + _1], slots[at + _2], slots[at + _BOUND]
            for k in range(count):
                d, e, f, r = xi - near[_4 * k], yi - near[_4 * k + _1], zi - near[_4 * k + _2], ri + near[_4 * k + _3]
                first[found], second[found] = at, near_slot[k]
                found += _1 if d * d + e * e + f * f < r * r else _0
    return found


@inlined
def _near_cluster(balls: Array, c: np.uint64, world: UInts, places: Array, shapes: np.uint64, near: Array, near_slot: UInts) -> np.uint64:
    """Gather the objects that touch a cluster's ball: the large ones, then cell by cell; returns how many."""
    u, v, w, radius = balls[c * _4], balls[c * _4 + _1], balls[c * _4 + _2], balls[c * _4 + _3]
    found = _scan(u, v, w, radius, _0, world[LARGE], world[COUNT], places, shapes, near, near_slot, _0)
    along = radius + places[WIDEST]
    x0, x1 = _span(u - places[CORNER], along, places[PER_METRE], world[CELLS])
    y0, y1 = _span(v - places[CORNER + 1], along, places[PER_METRE], world[CELLS + 1])
    z0, z1 = _span(w - places[CORNER + 2], along, places[PER_METRE], world[CELLS + 2])
    for k in range(z0, z1):
        for j in range(y0, y1):
            cell = np.uint64(W_START) + (k * world[CELLS + 1] + j) * world[CELLS]
            begin, end = world[cell + x0], world[cell + x1]
            found = _scan(u, v, w, radius, begin, end, world[COUNT], places, shapes, near, near_slot, found)
    return found


@inlined
def _span(offset: float, along: float, per_metre: float, cells: np.uint64) -> tuple[np.uint64, np.uint64]:
    """First and one past the last cell that [offset - along, offset + along] reaches; what lies outside counts to the edge cells."""
    last = float(cells) - 1.0
    low, high = (offset - along) * per_metre, (offset + along) * per_metre
    # In this order NaN, of coordinates that have overflown, becomes a cell as well.
    low, high = (low if low > 0.0 else 0.0), (high if high > 0.0 else 0.0)
    return np.uint64(min(low, last)), np.uint64(min(high, last)) + _1


@inlined
def _scan(
    u: float,
    v: float,
    w: float,
    radius: float,
    begin: np.uint64,
    end: np.uint64,
    count: np.uint64,
    places: Array,
    shapes: np.uint64,
    near: Array,
    near_slot: UInts,
    found: np.uint64,
) -> np.uint64:
    x0 = np.uint64(W_COLUMNS)
    y0, z0, r0 = x0 + count, x0 + _2 * count, x0 + _3 * count
    hits = 0
    for k in range(begin, end):
        d, e, f, r = u - places[x0 + k], v - places[y0 + k], w - places[z0 + k], radius + places[r0 + k]
        hits += 1 if d * d + e * e + f * f < r * r else 0
    if hits == 0:
        return found
    for k in range(begin, end):
        d, e, f, r = u - places[x0 + k], v - places[y0 + k], w - places[z0 + k], radius + places[r0 + k]
        o = _4 * found
        near[o], near[o + _1], near[o + _2], near[o + _3] = places[x0 + k], places[y0 + k], places[z0 + k], places[r0 + k]
        near_slot[found] = (shapes + k) * _SLOT
        found += _1 if d * d + e * e + f * f < r * r else _0
    return found
