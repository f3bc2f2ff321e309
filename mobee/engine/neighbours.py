"""The contacts of poses that follow each other closely, by a list of neighbours (Verlet): pairs nearer than the skin at one pose.

A list is of use until two volumes together may have moved by the skin since; until then a pair is looked at only when what its two
volumes have moved adds up to what was between them, and of two shapes of one hand also only when the joints between them have
turned enough.  What has not moved at all is neither placed nor tested again.  Where poses are far apart a list does not pay: every
pose is then evaluated as any other, until the steps become short.

What is remembered stands in the flat arrays of a `Memory`; nothing is allocated but the results.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mobee.engine.broad import own_pairs, world_pairs
from mobee.engine.compiled import entry, inlined, inner
from mobee.engine.feel import feel, place
from mobee.engine.kinematics import joint_angles
from mobee.engine.listed import MARGIN, gather, look
from mobee.engine.memory import Memory, memory_of
from mobee.engine.motion import bend_links, find_moved, measure, reach_out, remember
from mobee.engine.pack import CLUSTERS, JOINTS, Flags, UInts
from mobee.engine.place import bound_clusters
from mobee.engine.rows import NUMBERS, REALS, append_rows
from mobee.engine.sieve import sieve
from mobee.robot.robot import Array, Ints

# Header of the memory: what there is, how many pairs are listed, how many poses the list has served, how many no list is made for.
STATE, LISTED, SERVED, PAUSE = range(4)
EMPTY, PLACED, LIST, RENEW = range(4)  # nothing; the last pose; a list; the last pose, in a world that has changed under a useful list
_PLAIN, _BUILD, _USE = range(3)

WORTH = 4  # poses that a list must have served before an edit of the world to be made again at once, else so many go without
SHORT = 4.0  # steps of the present length that a new list must last to be worth making

_0, _4 = np.uint64(0), np.uint64(4)


class Around(NamedTuple):
    """A robot in a scene, as `follow` is given it."""

    integers: UInts
    floats: Array
    wide: Array
    vertices: Array
    world: UInts
    places: Array
    wide_places: Array
    carried: Ints
    own_shapes: int
    reaching: int
    skin: float
    cut: bool
    common: UInts
    slots: Array


@inner
def _choose(ints: Ints, most: float, skin: float) -> int:
    """How to evaluate a pose in which a shape may be `most` away [m] from the pose remembered."""
    state = ints[STATE]
    if state == LIST:
        if 2.0 * most < skin - MARGIN:
            ints[SERVED] += 1
            return _USE
        return _BUILD if ints[SERVED] > 1 else _PLAIN
    if ints[PAUSE] > 0:
        ints[PAUSE] -= 1
        return _PLAIN
    if state == RENEW or state == PLACED and SHORT * 2.0 * most < skin:
        return _BUILD
    return _PLAIN


@inner
def find(here: Around, q: Array, m: Memory) -> np.uint64:
    """Find the contacts of the pose at q (n,); returns how many are in the memory, in no order."""
    fresh = m.header[STATE] == EMPTY or m.header[STATE] == RENEW
    joint_angles(here.integers, here.floats, q, 0, m.angles)
    find_moved(here.integers, m.angles, m.last, fresh, m.moved)
    place(here.integers, here.floats, here.slots, m)
    farthest = 0.0
    if fresh:
        m.wrench[:] = 0.0
        reach_out(here.integers, here.slots, m.arm)
    else:
        enough = 0.5 * here.skin
        farthest = measure(here.integers, m.moved, m.frames, m.then, m.arm, m.x, m.y, m.z, m.x0, m.y0, m.z0, enough, m.turn, m.way)
    mode = _choose(m.header, farthest, here.skin)
    building = mode == _BUILD  # as a variable: a constant would be a type of its own, and `look` compiled once more
    return _among_listed(here, building, m) if mode == _USE else _among_all(here, building, m)


@inlined
def _among_listed(here: Around, building: bool, m: Memory) -> np.uint64:
    """The contacts of listed pairs."""
    joints = np.int64(here.integers[JOINTS])
    spans, levers = here.wide[len(here.floats) : len(here.floats) + joints], here.wide[len(here.floats) + joints :]
    bend_links(here.integers, m.angles, m.listed, spans, m.bend, m.sway, m.chain)
    pairs, found = gather(
        here.integers, m.way, here.common, levers, m.bend, m.sway, m.chain, m.first, m.second, m.gap, m.row_of,
        np.uint64(m.header[LISTED]), m.near_first, m.near_second, m.kept_numbers, m.kept_reals, m.found_numbers, m.found_reals,
    )  # fmt: skip
    return _look(here, building, m.near_first, m.near_second, pairs, found, m)[0]


@inlined
def _among_all(here: Around, building: bool, m: Memory) -> np.uint64:
    """The contacts of all pairs; `building`: the neighbours are listed too."""
    bound_clusters(here.integers, here.slots, m.x, m.y, m.z, m.balls)
    if building:
        for c in range(here.integers[CLUSTERS]):
            m.balls[_4 * c + np.uint64(3)] += here.skin
    reaches, places = here.wide if building else here.floats, here.wide_places if building else here.places
    pairs = own_pairs(here.integers, reaches, here.slots, m.x, m.y, m.z, m.balls, m.first, m.second)
    pairs = world_pairs(here.integers, here.slots, m.balls, here.world, places, m.near, m.near_slot, m.first, m.second, pairs)
    remember(m.angles, m.frames, m.x, m.y, m.z, m.listed, m.then, m.x0, m.y0, m.z0, m.way)
    if not building:
        pairs = sieve(here.slots, m.first, m.second, pairs)
    count, listed = _look(here, building, m.first, m.second, pairs, _0, m)
    m.header[STATE], m.header[LISTED], m.header[SERVED] = (LIST if building else PLACED), np.int64(listed), 0
    return count


@inlined
def _look(
    here: Around, building: bool, first: UInts, second: UInts, pairs: np.uint64, found: np.uint64, m: Memory
) -> tuple[np.uint64, np.uint64]:
    return look(
        here.integers, here.vertices, here.world, here.carried, here.own_shapes, here.reaching, here.skin, building, here.slots,
        first, second, m.gap, m.row_of, pairs, m.kept_numbers, m.kept_reals, m.out, m.found_numbers, m.found_reals, found,
    )  # fmt: skip


@entry(
    "Tuple((int64[::1], float64[::1], float64[:,::1]))("
    "uint64[::1], float64[::1], float64[::1], float64[::1], uint64[::1], float64[::1], float64[::1], int64[::1], int64, int64, "
    "float64, boolean, uint64[::1], float64[::1], float64[:,::1], float64[::1], uint64[::1], int64[::1], boolean[::1])"
)
def follow(
    integers: UInts,
    floats: Array,
    wide: Array,
    vertices: Array,
    world: UInts,
    places: Array,
    wide_places: Array,
    carried: Ints,
    own_shapes: int,
    reaching: int,
    skin: float,
    cut: bool,
    common: UInts,
    slots: Array,
    q: Array,
    reals_memory: Array,
    pairs_memory: UInts,
    ints: Ints,
    flags: Flags,
) -> tuple[Ints, Array, Array]:
    """What `evaluate.contacts` returns for poses q (B, n) that follow each other, and what it remembers for the next call.

    `wide`, `wide_places`: `floats` and `places` in which every pair and object reaches farther by the skin [m]; at the end of
    `wide` stand each joint's distance from the one before and each shape's from its own [m].  `common`: the last link that
    carries both of two links, (L L,).  `cut`: see `project`.  The last four: as long as `memory.sizes` says, and kept for the same
    robot, world and reaching link.
    """
    here = Around(integers, floats, wide, vertices, world, places, wide_places, carried, own_shapes, reaching, skin, cut, common, slots)
    m = memory_of(integers, world, reals_memory, pairs_memory, ints, flags)
    room, used = 16 + 4 * len(q), 0
    numbers, reals, torque = np.empty(room * NUMBERS, dtype=np.int64), np.empty(room * REALS), np.zeros(q.shape)
    for b in range(len(q)):
        count = find(here, q[b], m)
        if count == _0:
            continue
        feel(integers, floats, count, cut, m, torque[b])
        rows = np.int64(count)
        if used + rows > room:
            room = 2 * room + rows
            wider, taller = np.empty(room * NUMBERS, dtype=np.int64), np.empty(room * REALS)
            wider[: used * NUMBERS], taller[: used * REALS] = numbers[: used * NUMBERS], reals[: used * REALS]
            numbers, reals = wider, taller
        append_rows(b, m.found_numbers, m.found_reals, m.order, count, numbers, reals, np.uint64(used))
        used += rows
    return numbers[: used * NUMBERS], reals[: used * REALS], torque
