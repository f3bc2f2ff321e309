"""The contacts of one pose: found among the pairs that may touch, and put in order."""

from __future__ import annotations

import numpy as np

from mobee.engine.compiled import inlined, inner
from mobee.engine.forces import push
from mobee.engine.layout import SLOT
from mobee.engine.narrow.dispatch import overlap
from mobee.engine.numba_hands import BITS
from mobee.engine.pack import I_LINK, I_NAME, I_PARENT, I_ROLE, SHAPES, UInts
from mobee.engine.scene import CELLS, COUNT, W_START
from mobee.robot.robot import Array, Ints

NUMBERS, REALS = 6, 7  # of a contact: pose, kind, first, second, their links; depth, normal, point

_LINK = (1 << BITS) - 1
_0, _1, _2, _3, _4, _5, _6 = (np.uint64(k) for k in range(7))
_SLOT, _NUMBERS, _REALS = np.uint64(SLOT), np.uint64(NUMBERS), np.uint64(REALS)


@inlined
def _swap(numbers: Ints, n: np.uint64, out: Array) -> None:
    """Let the second be the first."""
    for k in (_2, _4):
        numbers[n + k], numbers[n + k + _1] = numbers[n + k + _1], numbers[n + k]
    out[0], out[1], out[2] = -out[0], -out[1], -out[2]


@inlined
def _name(integers: UInts, name: np.uint64, i: np.uint64, own_shapes: int, carried: Ints) -> int:
    """Index into the names: the robot's shapes, then the objects of the snapshot."""
    given = np.int64(integers[name + i])
    return given if given < own_shapes else own_shapes + carried[given - own_shapes]


@inlined
def carried_by(integers: UInts, link: int, carrier: int) -> bool:
    """Whether a link is that one, or mounted on it; what carries a link has a smaller number."""
    while link > carrier:
        link = np.int64(integers[np.int64(integers[I_PARENT]) + link - 1])
    return link == carrier


@inlined
def spares(integers: UInts, link: int, field: bool, reaching: int) -> bool:
    """Whether a volume of a link is one of those that reach, see `hands`."""
    while reaching > 0:
        hand, fields = (reaching & _LINK) - 1, (reaching >> BITS & _LINK) - 1
        if carried_by(integers, link, hand) or (field and carried_by(integers, link, fields)):
            return True
        reaching >>= 2 * BITS
    return False


@inner
def find_contacts(
    integers: UInts,
    vertices: Array,
    world: UInts,
    carried: Ints,
    own_shapes: int,
    reaching: int,
    slots: Array,
    first: UInts,
    second: UInts,
    pairs: np.uint64,
    out: Array,
    numbers: Ints,
    reals: Array,
) -> np.uint64:
    """Write a contact for every pair that overlaps to the rows of `numbers` and `reals`; returns how many."""
    found = _0
    for p in range(pairs):
        a, b = first[p], second[p]
        depth = overlap(slots, np.int64(a), np.int64(b), vertices, out)
        if depth > 0.0:
            found += write_contact(integers, world, carried, own_shapes, reaching, a, b, depth, out, numbers, reals, found)
    return found


@inlined
def write_contact(
    integers: UInts,
    world: UInts,
    carried: Ints,
    own_shapes: int,
    reaching: int,
    a: np.uint64,
    b: np.uint64,
    depth: float,
    out: Array,
    numbers: Ints,
    reals: Array,
    row: np.uint64,
) -> np.uint64:
    """Write the contact of the slots at a and b to a row; returns 1, or 0 if it is a target, spared by what reaches."""
    shapes, link, name, role = integers[SHAPES], integers[I_LINK], integers[I_NAME], integers[I_ROLE]
    i, j = a // _SLOT, b // _SLOT
    n, r = row * _NUMBERS, row * _REALS
    numbers[n + _1] = integers[role + i] | (integers[role + j] if j < shapes else _0)  # a carried object meets fields too
    numbers[n + _2] = _name(integers, name, i, own_shapes, carried)
    numbers[n + _4] = integers[link + i]
    if j < shapes:
        numbers[n + _3] = _name(integers, name, j, own_shapes, carried)
        numbers[n + _5] = integers[link + j]
        if numbers[n + _3] < numbers[n + _2]:
            _swap(numbers, n, out)
    else:
        order = np.uint64(W_START) + world[CELLS] * world[CELLS + 1] * world[CELLS + 2] + _1
        if world[order + world[COUNT] + (j - shapes)] == _1 and spares(
            integers, np.int64(integers[link + i]), integers[role + i] == _1, reaching
        ):
            return _0
        numbers[n + _3] = own_shapes + np.int64(world[order + (j - shapes)])
        numbers[n + _5] = -1
    reals[r] = depth
    for k in range(_6):
        reals[r + _1 + k] = out[k]
    return _1


@inner
def sort_rows(numbers: Ints, count: np.uint64, keys: Ints, order: Ints) -> None:
    """Fill `order` with the rows by kind, first and second (shell sort: mostly a handful, at times hundreds)."""
    for i in range(count):
        n = i * _NUMBERS
        keys[i] = (numbers[n + _1] << 60) | (numbers[n + _2] << 30) | numbers[n + _3]
        order[i] = i
    gap = _1
    while gap < count // _3:
        gap = _3 * gap + _1
    while gap > _0:
        for i in range(gap, count):
            key, row, j = keys[i], order[i], i
            while j >= gap and keys[j - gap] > key:
                keys[j], order[j] = keys[j - gap], order[j - gap]
                j -= gap
            keys[j], order[j] = key, row
        gap = gap // _3


@inner
def append_rows(
    pose: int, found_numbers: Ints, found_reals: Array, order: Ints, count: np.uint64, numbers: Ints, reals: Array, used: np.uint64
) -> None:
    """Copy the rows of one pose, in order, behind the `used` rows of the poses before."""
    for c in range(count):
        row = np.uint64(order[c])
        n, r, m, o = (used + c) * _NUMBERS, (used + c) * _REALS, row * _NUMBERS, row * _REALS
        numbers[n] = pose
        for k in range(_1, _NUMBERS):
            numbers[n + k] = found_numbers[m + k]
        for k in range(_REALS):
            reals[r + k] = found_reals[o + k]


@inner
def push_links(numbers: Ints, reals: Array, order: Ints, count: np.uint64, wrench: Array) -> None:
    """Add depth * normal of every field contact to its first link, and the opposite to its second.

    In the order of the rows: the sum does not depend on how they were found.
    """
    for c in range(count):
        row = np.uint64(order[c])
        n, r = row * _NUMBERS, row * _REALS
        if numbers[n + _1] != 1:
            continue
        depth = reals[r]
        fx, fy, fz = depth * reals[r + _1], depth * reals[r + _2], depth * reals[r + _3]
        x, y, z = reals[r + _4], reals[r + _5], reals[r + _6]
        push(wrench, np.uint64(numbers[n + _4]), fx, fy, fz, x, y, z)
        if numbers[n + _5] >= 0:
            push(wrench, np.uint64(numbers[n + _5]), -fx, -fy, -fz, x, y, z)
