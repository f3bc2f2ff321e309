"""What Python calls: many poses at once; one pose is a batch of one, so that both give the same to the last bit."""

from __future__ import annotations

import numpy as np

from mobee.engine.broad import own_pairs, world_pairs
from mobee.engine.compiled import entry
from mobee.engine.feel import feel, place
from mobee.engine.kinematics import joint_angles, place_links, sines_cosines
from mobee.engine.layout import ROW
from mobee.engine.memory import memory_of
from mobee.engine.pack import (
    DRIVES,
    F_AXIS,
    F_POINT,
    F_ROW,
    F_SCALE,
    I_KIND,
    I_MOTOR,
    I_PARENT,
    JOINTS,
    LINKS,
    MOTORS,
    SHAPES,
    Flags,
    UInts,
)
from mobee.engine.place import bound_clusters, settle_slots
from mobee.engine.rows import REALS, append_rows, find_contacts
from mobee.engine.scene import CELLS, COUNT, W_START
from mobee.engine.sieve import sieve
from mobee.robot.robot import Array, Ints

_ROW = np.uint64(ROW)


@entry("float64[:,:,:,::1](uint64[::1], float64[::1], float64[:,::1])")
def link_poses(integers: UInts, floats: Array, q: Array) -> Array:
    """Every link in every pose, (B, L, 4, 4) from q (B, n)."""
    count, links = len(q), np.int64(integers[LINKS])
    joints = np.int64(integers[JOINTS])
    angles, sines, cosines = np.empty(joints), np.empty(joints), np.empty(joints)
    flat, moved = np.empty(12 * links), np.ones(links, dtype=np.bool_)
    out = np.empty((count, links, 4, 4))
    motors = q.ravel()
    for b in range(count):
        joint_angles(integers, floats, motors, b * q.shape[1], angles)
        sines_cosines(angles, sines, cosines)
        place_links(integers, floats, angles, sines, cosines, moved, flat)
        for link in range(links):
            for k in range(3):
                for c in range(4):
                    out[b, link, k, c] = flat[12 * link + 4 * k + c]
            out[b, link, 3, 0] = out[b, link, 3, 1] = out[b, link, 3, 2] = 0.0
            out[b, link, 3, 3] = 1.0
    return out


@entry(
    "UniTuple(int64, 2)("
    "uint64[::1], float64[::1], float64[::1], uint64[::1], float64[::1], int64[::1], int64, int64, boolean, float64[:,::1], int64, "
    "float64[::1], float64[::1], uint64[::1], int64[::1], boolean[::1], int64[::1], float64[::1], float64[:,::1])"
)
def contacts(
    integers: UInts,
    floats: Array,
    vertices: Array,
    world: UInts,
    places: Array,
    carried: Ints,
    own_shapes: int,
    reaching: int,
    cut: bool,
    q: Array,
    begin: int,
    slots: Array,
    work: Array,
    lists: UInts,
    spare: Ints,
    flags: Flags,
    numbers: Ints,
    reals: Array,
    torque: Array,
) -> tuple[int, int]:
    """Write every contact in the poses q[begin], q[begin + 1], ... to the rows of `numbers` and `reals`, its forces to `torque` (B, n).

    Returns the pose that found no room for its rows, len(q) if all did, and how many rows are written.  `slots` ... `reals`: a
    Room settled for the scene.
    """
    m = memory_of(integers, world, work, lists, spare, flags)
    used = 0
    m.moved[:] = True
    m.wrench[:] = 0.0
    for b in range(begin, len(q)):
        joint_angles(integers, floats, q[b], 0, m.angles)
        place(integers, floats, slots, m)
        bound_clusters(integers, slots, m.x, m.y, m.z, m.balls)
        pairs = own_pairs(integers, floats, slots, m.x, m.y, m.z, m.balls, m.first, m.second)
        pairs = world_pairs(integers, slots, m.balls, world, places, m.near, m.near_slot, m.first, m.second, pairs)
        pairs = sieve(slots, m.first, m.second, pairs)
        count = find_contacts(
            integers, vertices, world, carried, own_shapes, reaching, slots, m.first, m.second, pairs, m.out, m.found_numbers, m.found_reals
        )
        rows = np.int64(count)
        if (used + rows) * REALS > len(reals):
            return b, used
        if rows > 0:
            feel(integers, floats, count, cut, m, torque[b])
            append_rows(b, m.found_numbers, m.found_reals, m.order, count, numbers, reals, np.uint64(used))
            used += rows
    return len(q), used


@entry("void(uint64[::1], float64[::1], uint64[::1], float64[::1], float64[::1])")
def settle(integers: UInts, floats: Array, world: UInts, rows: Array, slots: Array) -> None:
    """Fill what does not change with the pose: of every shape, and of the free objects in the order of the scene."""
    settle_slots(floats, integers[F_ROW], np.uint64(0), integers[SHAPES], slots)
    order = np.uint64(W_START) + world[CELLS] * world[CELLS + 1] * world[CELLS + 2] + np.uint64(1)
    for k in range(world[COUNT]):
        settle_slots(rows, world[order + k] * _ROW, integers[SHAPES] + k, np.uint64(1), slots)


@entry("float64[:,:,::1](uint64[::1], float64[::1], float64[:,::1], int64, float64[:,::1])")
def jacobians(integers: UInts, floats: Array, q: Array, link: int, point: Array) -> Array:
    """How points fixed to a link move with each motor, (B, 6, n): `point` (B, 3), in the link's frame, which is the root's at zero pose."""
    joints, links, motors = np.int64(integers[JOINTS]), np.int64(integers[LINKS]), np.int64(integers[MOTORS])
    angles, sines, cosines, frames = np.empty(joints), np.empty(joints), np.empty(joints), np.empty(12 * links)
    out, moved = np.zeros((len(q), 6, motors)), np.ones(links, dtype=np.bool_)
    flat = q.ravel()
    for b in range(len(q)):
        joint_angles(integers, floats, flat, b * motors, angles)
        sines_cosines(angles, sines, cosines)
        place_links(integers, floats, angles, sines, cosines, moved, frames)
        t = 12 * link
        x = frames[t] * point[b, 0] + frames[t + 1] * point[b, 1] + frames[t + 2] * point[b, 2] + frames[t + 3]
        y = frames[t + 4] * point[b, 0] + frames[t + 5] * point[b, 1] + frames[t + 6] * point[b, 2] + frames[t + 7]
        z = frames[t + 8] * point[b, 0] + frames[t + 9] * point[b, 1] + frames[t + 10] * point[b, 2] + frames[t + 11]
        here = link
        while here > 0:
            j, t = here - 1, 12 * here
            a, p = np.int64(integers[F_AXIS]) + 3 * j, np.int64(integers[F_POINT]) + 3 * j
            u = frames[t] * floats[a] + frames[t + 1] * floats[a + 1] + frames[t + 2] * floats[a + 2]
            v = frames[t + 4] * floats[a] + frames[t + 5] * floats[a + 1] + frames[t + 6] * floats[a + 2]
            w = frames[t + 8] * floats[a] + frames[t + 9] * floats[a + 1] + frames[t + 10] * floats[a + 2]
            d = x - (frames[t] * floats[p] + frames[t + 1] * floats[p + 1] + frames[t + 2] * floats[p + 2] + frames[t + 3])
            e = y - (frames[t + 4] * floats[p] + frames[t + 5] * floats[p + 1] + frames[t + 6] * floats[p + 2] + frames[t + 7])
            f = z - (frames[t + 8] * floats[p] + frames[t + 9] * floats[p + 1] + frames[t + 10] * floats[p + 2] + frames[t + 11])
            slides = integers[integers[I_KIND] + np.uint64(j)] == np.uint64(1)
            for slot in range(np.int64(integers[DRIVES])):
                motor = np.int64(integers[np.int64(integers[I_MOTOR]) + slot * joints + j])
                scale = floats[np.int64(integers[F_SCALE]) + slot * joints + j]
                if slides:
                    out[b, 0, motor] += scale * u
                    out[b, 1, motor] += scale * v
                    out[b, 2, motor] += scale * w
                    continue
                out[b, 0, motor] += scale * (v * f - w * e)
                out[b, 1, motor] += scale * (w * d - u * f)
                out[b, 2, motor] += scale * (u * e - v * d)
                out[b, 3, motor] += scale * u
                out[b, 4, motor] += scale * v
                out[b, 5, motor] += scale * w
            here = np.int64(integers[np.int64(integers[I_PARENT]) + j])
    return out
