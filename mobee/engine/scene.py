"""The free objects of one state of the world as two flat arrays, sorted into the cells of a grid.

Header of `integers`: objects, of which large, cells along x, y and z; then where each cell begins, which object of the snapshot
each one is, and which are targets.  `floats`: the grid's corner, cells per metre, the largest radius in the grid; then the
columns x, y, z and radius.  Large objects (a table) come first and are always looked at.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mobee.collision.snapshot import OBSTACLE, TARGET, Snapshot
from mobee.engine.compiled import entry, inner, inner_with_memory
from mobee.engine.layout import ROW, ROW_BOUND, ROW_POSITION
from mobee.engine.pack import Packed, UInts
from mobee.robot.robot import Array, Ints

COUNT, LARGE, CELLS = 0, 1, 2
W_START = 5
CORNER, PER_METRE, WIDEST = 0, 3, 4
W_COLUMNS = 5
GRID_FROM = 100  # objects; fewer are looked at one after the other, in vector instructions, at no more cost
PER_CELL = 8  # objects, aimed at


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A robot among the free objects of one snapshot.  It never changes."""

    snapshot: Snapshot
    rows: Array  # (N ROW,)
    packed: Packed
    integers: UInts
    floats: Array
    carried: Ints  # for each carried object its index in the snapshot


def scene(packed: Packed, snapshot: Snapshot, carried: Ints) -> Scene:
    """Sort the snapshot's free objects."""
    count = len(snapshot.roles)
    side = 1 if count < GRID_FROM else max(1, int((count / PER_CELL) ** (1.0 / 3.0)))
    integers = np.zeros(W_START + side**3 + 1 + 2 * count, dtype=np.uint64)
    floats = np.zeros(W_COLUMNS + 4 * count)
    rows = np.zeros((count, ROW))
    for row, volume in zip(rows, snapshot.rows, strict=True):
        row[:] = [volume["kind"], *volume["position"], *volume["rotation"].ravel(), *volume["half"], volume["bound"]]
    sort_objects(rows.ravel(), snapshot.roles, side, integers, floats)
    return Scene(snapshot, rows.ravel(), packed, integers, floats, carried)


@inner
def _cell(rows: Array, i: int, cells: Ints, floats: Array) -> int:
    """Number of the cell that holds the centre of object i; x runs fastest."""
    number = 0
    for k in range(2, -1, -1):
        along = int((rows[i * ROW + ROW_POSITION + k] - floats[CORNER + k]) * floats[PER_METRE])
        number = number * cells[k] + min(max(along, 0), cells[k] - 1)
    return number


@inner_with_memory
def _file(rows: Array, roles: Ints, usual: float, cells: Ints, integers: UInts, floats: Array) -> None:
    """Counting sort of the objects by cell, the large ones before all cells."""
    count, large = np.int64(integers[COUNT]), np.int64(integers[LARGE])
    number = cells[0] * cells[1] * cells[2]
    home = np.empty(len(roles), dtype=np.int64)
    filled = np.zeros(number + 1, dtype=np.int64)
    for i in range(len(roles)):
        home[i] = -1
        if roles[i] != OBSTACLE and roles[i] != TARGET:
            home[i] = -2
        elif rows[i * ROW + ROW_BOUND] <= usual:
            home[i] = _cell(rows, i, cells, floats)
            filled[home[i] + 1] += 1
    for c in range(number):
        filled[c + 1] += filled[c]
    order, target = W_START + number + 1, W_START + number + 1 + count
    for c in range(number + 1):
        integers[W_START + c] = large + filled[c]
    next_large = 0
    for i in range(len(roles)):
        if home[i] == -2:
            continue
        if home[i] == -1:
            k = next_large
            next_large += 1
        else:
            k = large + filled[home[i]]
            filled[home[i]] += 1
        integers[order + k] = i
        integers[target + k] = roles[i] == TARGET
        for axis in range(3):
            floats[W_COLUMNS + axis * count + k] = rows[i * ROW + ROW_POSITION + axis]
        floats[W_COLUMNS + 3 * count + k] = rows[i * ROW + ROW_BOUND]


@entry("void(float64[::1], int64[::1], int64, uint64[::1], float64[::1])")
def sort_objects(rows: Array, roles: Ints, side: int, integers: UInts, floats: Array) -> None:
    """Fill the two arrays of a scene from the rows and roles of a snapshot."""
    free = 0
    widest, total = 0.0, 0.0
    for i in range(len(roles)):
        if roles[i] == OBSTACLE or roles[i] == TARGET:
            free += 1
            total += rows[i * ROW + ROW_BOUND]
    if free == 0:
        return
    usual = 3.0 * total / free
    low, high = np.full(3, math.inf), np.full(3, -math.inf)
    large = 0
    for i in range(len(roles)):
        if roles[i] != OBSTACLE and roles[i] != TARGET:
            continue
        if rows[i * ROW + ROW_BOUND] > usual:
            large += 1
            continue
        widest = max(widest, rows[i * ROW + ROW_BOUND])
        for k in range(3):
            low[k] = min(low[k], rows[i * ROW + ROW_POSITION + k])
            high[k] = max(high[k], rows[i * ROW + ROW_POSITION + k])
    if large == free:
        low[:], high[:] = 0.0, 1.0
    longest = max(high[0] - low[0], high[1] - low[1], high[2] - low[2])
    edge = longest / side if longest > 0.0 else 1.0
    cells = np.empty(3, dtype=np.int64)
    for k in range(3):
        cells[k] = min(side, max(1, int(math.ceil((high[k] - low[k]) / edge))))
    integers[COUNT], integers[LARGE] = free, large
    for k in range(3):
        integers[CELLS + k] = cells[k]
        floats[CORNER + k] = low[k]
    floats[PER_METRE], floats[WIDEST] = 1.0 / edge, widest
    _file(rows, roles, usual, cells, integers, floats)
