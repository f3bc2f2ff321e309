"""The contacts of poses that follow each other closely, by a list of neighbours (Verlet): pairs nearer than the skin at one pose.

A list is of use until two volumes together may have moved by the skin since; until then a pair is looked at only when what its two
volumes have moved adds up to what was between them, and of two shapes of one hand also only when the joints between them have
turned enough.  What has not moved at all is neither placed nor tested again.  Where poses are far apart a list does not pay: every
pose is then evaluated as any other, until the steps become short.

What is remembered stands in three flat arrays, see `sizes`; nothing is allocated but the results.
"""

from __future__ import annotations

import numpy as np

from mobee.engine.broad import own_pairs, world_pairs
from mobee.engine.compiled import entry, inner
from mobee.engine.forces import project
from mobee.engine.kinematics import joint_angles, place_links, sines_cosines
from mobee.engine.listed import MARGIN, gather, look
from mobee.engine.motion import bend_links, find_moved, measure, reach_out
from mobee.engine.pack import CLUSTERS, JOINTS, LINKS, SHAPES, UInts
from mobee.engine.place import bound_clusters, place_shapes
from mobee.engine.rows import NUMBERS, REALS, append_rows, push_links, sort_rows
from mobee.engine.scene import COUNT
from mobee.engine.sieve import sieve
from mobee.robot.robot import Array, Ints

# Header of `ints`: what there is, how many pairs are listed, how many poses the list has served, how many no list is made for.
STATE, LISTED, SERVED, PAUSE = range(4)
HEADER = 4
EMPTY, PLACED, LIST, RENEW = range(4)  # nothing; the last pose; a list; the last pose, in a world that has changed under a useful list
_PLAIN, _BUILD, _USE = range(3)

WORTH = 4  # poses that a list must have served before an edit of the world to be made again at once, else so many go without
SHORT = 4.0  # steps of the present length that a new list must last to be worth making

_0 = np.uint64(0)


def sizes(joints: int, links: int, shapes: int, objects: int) -> tuple[int, int, int]:
    """How long the arrays of floats, of unsigned and of signed integers are, in this order."""
    most = shapes * (shapes + 1) // 2 + shapes * objects
    return (
        2 * joints + 24 * links + 8 * shapes + 5 * objects + most * (1 + 2 * REALS),
        4 * most + objects,
        HEADER + most * (3 + 2 * NUMBERS),
    )


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


@entry(
    "Tuple((int64[::1], float64[::1], float64[:,::1]))("
    "uint64[::1], float64[::1], float64[::1], float64[::1], uint64[::1], float64[::1], float64[::1], int64[::1], int64, int64, "
    "float64, float64[:,::1], float64[::1], float64[::1], uint64[::1], int64[::1], uint64[::1])"
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
    q: Array,
    slots: Array,
    memory: Array,
    pairs_memory: UInts,
    ints: Ints,
    common: UInts,
) -> tuple[Ints, Array, Array]:
    """What `evaluate.contacts` returns for poses q (B, n) that follow each other, and what it remembers for the next call.

    `wide`, `wide_places`: `floats` and `places` in which every pair and object reaches farther by the skin [m]; at the end of
    `wide` stand each joint's distance from the one before and each shape's from its own [m].  `common`: the last link that
    carries both of two links, (L L,).  `memory`, `pairs_memory` and `ints`: as long as `sizes` says, and kept for the same robot,
    world and reaching link.
    """
    joints, links, shapes = np.int64(integers[JOINTS]), np.int64(integers[LINKS]), np.int64(integers[SHAPES])
    objects, motors = np.int64(world[COUNT]), q.shape[1]
    most = shapes * (shapes + 1) // 2 + shapes * objects
    o, n = 2 * joints, 12 * links
    last, angles0 = memory[:joints], memory[joints:o]
    frames, then = memory[o : o + n], memory[o + n : o + 2 * n]
    o, n = o + 2 * n, shapes
    x, y, z = memory[o : o + n], memory[o + n : o + 2 * n], memory[o + 2 * n : o + 3 * n]
    x0, y0, z0 = memory[o + 3 * n : o + 4 * n], memory[o + 4 * n : o + 5 * n], memory[o + 5 * n : o + 6 * n]
    arm, way = memory[o + 6 * n : o + 7 * n], memory[o + 7 * n : o + 8 * n + objects]
    o, n = o + 8 * n + objects, most
    near, gap = memory[o : o + 4 * objects], memory[o + 4 * objects : o + 4 * objects + n]
    o = o + 4 * objects + n
    kept_reals, found_reals = memory[o : o + n * REALS], memory[o + n * REALS : o + 2 * n * REALS]
    first, second, near_slot = pairs_memory[:n], pairs_memory[n : 2 * n], pairs_memory[4 * n :]
    near_first, near_second = pairs_memory[2 * n : 3 * n], pairs_memory[3 * n : 4 * n]
    o = HEADER
    row_of, keys, order = ints[o : o + n], ints[o + n : o + 2 * n], ints[o + 2 * n : o + 3 * n]
    o = o + 3 * n
    kept_numbers, found_numbers = ints[o : o + n * NUMBERS], ints[o + n * NUMBERS : o + 2 * n * NUMBERS]
    angles, sines, cosines = np.empty(joints), np.empty(joints), np.empty(joints)
    moved, turn, balls = np.empty(links, dtype=np.bool_), np.empty(links), np.empty(4 * np.int64(integers[CLUSTERS]))
    bend, sway, chain = np.empty(links), np.empty(links), np.empty(links)
    spans, levers = wide[len(floats) : len(floats) + joints], wide[len(floats) + joints :]
    wrench, out = np.zeros(6 * links), np.empty(6)
    room, used = 16 + 4 * len(q), 0
    numbers, reals, torque = np.empty(room * NUMBERS, dtype=np.int64), np.empty(room * REALS), np.zeros(q.shape)
    given, torques = q.ravel(), torque.ravel()
    for b in range(len(q)):
        fresh = ints[STATE] == EMPTY or ints[STATE] == RENEW
        joint_angles(integers, floats, given, b * motors, angles)
        sines_cosines(angles, sines, cosines)
        find_moved(integers, angles, last, fresh, moved)
        place_links(integers, floats, angles, sines, cosines, moved, frames)
        place_shapes(integers, floats, frames, moved, slots, x, y, z)
        farthest = 0.0
        if fresh:
            reach_out(integers, slots, arm)
        else:
            farthest = measure(integers, moved, frames, then, arm, x, y, z, x0, y0, z0, 0.5 * skin, turn, way)
        mode, found, building = _choose(ints, farthest, skin), _0, False
        one, two = first, second
        if mode == _USE:
            bend_links(integers, angles, angles0, spans, bend, sway, chain)
            one, two = near_first, near_second
            pairs, found = gather(
                integers, way, common, levers, bend, sway, chain, first, second, gap, row_of, np.uint64(ints[LISTED]), one, two,
                kept_numbers, kept_reals, found_numbers, found_reals,
            )  # fmt: skip
        else:
            building = mode == _BUILD
            bound_clusters(integers, slots, x, y, z, balls)
            if building:
                for c in range(len(balls) // 4):
                    balls[4 * c + 3] += skin
            pairs = own_pairs(integers, wide if building else floats, slots, x, y, z, balls, first, second)
            pairs = world_pairs(integers, slots, balls, world, wide_places if building else places, near, near_slot, first, second, pairs)
            angles0[:], then[:], x0[:], y0[:], z0[:] = angles, frames, x, y, z
            way[:] = 0.0
        if not building:
            pairs = sieve(slots, one, two, pairs)
        count, listed = look(
            integers, vertices, world, carried, own_shapes, reaching, skin, building, slots, one, two, gap, row_of, pairs,
            kept_numbers, kept_reals, out, found_numbers, found_reals, found,
        )  # fmt: skip
        if mode != _USE:
            ints[STATE], ints[LISTED], ints[SERVED] = (LIST if building else PLACED), np.int64(listed), 0
        if count == _0:
            continue
        rows = np.int64(count)
        if used + rows > room:
            room = 2 * room + rows
            wider, taller = np.empty(room * NUMBERS, dtype=np.int64), np.empty(room * REALS)
            wider[: used * NUMBERS], taller[: used * REALS] = numbers[: used * NUMBERS], reals[: used * REALS]
            numbers, reals = wider, taller
        sort_rows(found_numbers, count, keys, order)
        append_rows(b, found_numbers, found_reals, order, count, numbers, reals, np.uint64(used))
        push_links(numbers, reals, np.uint64(used), count, wrench)
        project(integers, floats, frames, wrench, False, torques, b * motors)
        used += rows
    return numbers[: used * NUMBERS], reals[: used * REALS], torque
