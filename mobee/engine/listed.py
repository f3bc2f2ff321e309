"""The pairs of a list of neighbours: those that may have met since it was made, and the contacts among them."""

from __future__ import annotations

import numpy as np

from mobee.engine.compiled import inner
from mobee.engine.layout import SLOT
from mobee.engine.motion import swung
from mobee.engine.narrow.dispatch import overlap
from mobee.engine.pack import I_LINK, LINKS, SHAPES, UInts
from mobee.engine.rows import NUMBERS, REALS, write_contact
from mobee.robot.robot import Array, Ints

MARGIN = 1e-9  # m: above the rounding of distances and of what was moved

_0, _1 = np.uint64(0), np.uint64(1)
_SLOT, _NUMBERS, _REALS = np.uint64(SLOT), np.uint64(NUMBERS), np.uint64(REALS)


@inner
def gather(
    integers: UInts,
    way: Array,
    common: UInts,
    levers: Array,
    bend: Array,
    sway: Array,
    chain: Array,
    first: UInts,
    second: UInts,
    gap: Array,
    row_of: Ints,
    listed: np.uint64,
    near_first: UInts,
    near_second: UInts,
    kept_numbers: Ints,
    kept_reals: Array,
    numbers: Ints,
    reals: Array,
) -> tuple[np.uint64, np.uint64]:
    """Collect the listed pairs that may have met; returns how many, and how many rows are written of those that have not moved."""
    near, found, shapes, links, link = _0, _0, integers[SHAPES], integers[LINKS], integers[I_LINK]
    for p in range(listed):
        a, b = first[p], second[p]
        i, j = a // _SLOT, b // _SLOT
        between = way[i] + way[j]
        if between < gap[p]:
            continue
        if between == 0.0:  # both are where they were when the list was made
            if row_of[p] >= 0:
                _copy(kept_numbers, kept_reals, np.uint64(row_of[p]), numbers, reals, found)
                found += _1
            continue
        if gap[p] > 0.0 and j < shapes:
            one, two = integers[link + i], integers[link + j]
            base = common[one * links + two]
            if swung(one, base, levers[i], bend, sway, chain) + swung(two, base, levers[j], bend, sway, chain) < gap[p]:
                continue
        near_first[near], near_second[near] = a, b
        near += _1
    return near, found


@inner
def look(
    integers: UInts,
    vertices: Array,
    world: UInts,
    carried: Ints,
    own_shapes: int,
    reaching: int,
    skin: float,
    building: bool,
    slots: Array,
    first: UInts,
    second: UInts,
    gap: Array,
    row_of: Ints,
    pairs: np.uint64,
    kept_numbers: Ints,
    kept_reals: Array,
    out: Array,
    numbers: Ints,
    reals: Array,
    found: np.uint64,
) -> tuple[np.uint64, np.uint64]:
    """Write the contacts among the pairs behind `found` rows; returns how many rows there are now, and how many pairs are listed.

    If a list is being built, neighbours stay in the arrays, with what is between them and the row of their contact.
    """
    listed = _0
    for p in range(pairs):
        a, b = first[p], second[p]
        depth = overlap(slots, np.int64(a), np.int64(b), vertices, out)
        if building:
            if -depth >= skin:
                continue
            first[listed], second[listed], gap[listed], row_of[listed] = a, b, -depth - MARGIN, -1
            listed += _1
        if depth > 0.0:
            written = write_contact(integers, world, carried, own_shapes, reaching, a, b, depth, out, numbers, reals, found)
            if building and written == _1:
                _copy(numbers, reals, found, kept_numbers, kept_reals, found)
                row_of[listed - _1] = np.int64(found)
            found += written
    return found, listed


@inner
def _copy(from_numbers: Ints, from_reals: Array, here: np.uint64, numbers: Ints, reals: Array, there: np.uint64) -> None:
    """Copy one row."""
    for k in range(_NUMBERS):
        numbers[there * _NUMBERS + k] = from_numbers[here * _NUMBERS + k]
    for k in range(_REALS):
        reals[there * _REALS + k] = from_reals[here * _REALS + k]
