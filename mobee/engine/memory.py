"""What evaluations of poses work in, and what they remember from one pose to the next: four flat arrays, seen as many.

Fresh memory costs more than the arithmetic of a pose, and handing many arrays to compiled code costs about as much.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mobee.engine.compiled import inner_with_memory
from mobee.engine.pack import CLUSTERS, JOINTS, LINKS, SHAPES, Flags, UInts
from mobee.engine.rows import NUMBERS, REALS
from mobee.engine.scene import COUNT
from mobee.robot.robot import Array, Ints

HEADER = 4  # integers in front, see `neighbours`


class Memory(NamedTuple):
    """The arrays of one user: of joints (J,), links (L,), shapes (S,), objects (O,), clusters (C,), pairs (P,)."""

    angles: Array  # (J,) now, like `sines` and `cosines`, see `sines_cosines`
    sines: Array
    cosines: Array
    last: Array  # (J,) angles at which everything is placed
    listed: Array  # (J,) angles at which the list was made; so are `then`, x0, y0, z0
    frames: Array  # (12 L,)
    then: Array
    wrench: Array  # (6 L,), zero between two poses
    turn: Array  # (L,), see `measure`
    bend: Array  # (L,), see `bend_links`, like `sway` and `chain`
    sway: Array
    chain: Array
    x: Array  # (S,) m
    y: Array
    z: Array
    x0: Array
    y0: Array
    z0: Array
    arm: Array  # (S,), see `reach_out`
    way: Array  # (S + O,), see `measure`
    balls: Array  # (4 C,)
    near: Array  # (4 O,)
    out: Array  # (6,)
    gap: Array  # (P,), see `look`
    kept_reals: Array  # (P REALS,) of contacts when the list was made
    found_reals: Array  # of contacts now
    moved: Flags  # (L,)
    near_slot: UInts  # (O,)
    first: UInts  # (P,) pairs, or the list
    second: UInts
    near_first: UInts  # (P,) pairs of the list that are looked at
    near_second: UInts
    header: Ints  # (HEADER,)
    row_of: Ints  # (P,), see `look`
    keys: Ints  # (P,), see `sort_rows`, like `order`
    order: Ints
    kept_numbers: Ints  # (P NUMBERS,)
    found_numbers: Ints


def sizes(joints: int, links: int, shapes: int, clusters: int, objects: int) -> tuple[int, int, int, int]:
    """How long the arrays of floats, of unsigned and of signed integers and of flags are, in this order."""
    most = most_pairs(shapes, objects)
    return (
        5 * joints + 34 * links + 8 * shapes + 4 * clusters + 5 * objects + 6 + most * (1 + 2 * REALS),
        4 * most + objects,
        HEADER + most * (3 + 2 * NUMBERS),
        links,
    )


def most_pairs(shapes: int, objects: int) -> int:
    """How many pairs there are at most."""
    return shapes * (shapes + 1) // 2 + shapes * objects


@inner_with_memory  # the caller counts the references to the views
def memory_of(integers: UInts, world: UInts, floats: Array, unsigned: UInts, signed: Ints, flags: Flags) -> Memory:
    """The views of the four arrays, which are as long as `sizes` says."""
    j, n, s = np.int64(integers[JOINTS]), np.int64(integers[LINKS]), np.int64(integers[SHAPES])
    c, o = np.int64(integers[CLUSTERS]), np.int64(world[COUNT])
    p = s * (s + 1) // 2 + s * o
    a = 5 * j  # where the links begin, then the shapes, the rest, the pairs
    b = a + 34 * n
    d = b + 8 * s + o
    e = d + 4 * c + 4 * o + 6
    f, g = e + p, e + p + p * REALS
    h = HEADER + 3 * p
    return Memory(
        floats[:j], floats[j : 2 * j], floats[2 * j : 3 * j], floats[3 * j : 4 * j], floats[4 * j : a],
        floats[a : a + 12 * n], floats[a + 12 * n : a + 24 * n], floats[a + 24 * n : a + 30 * n],
        floats[a + 30 * n : a + 31 * n], floats[a + 31 * n : a + 32 * n], floats[a + 32 * n : a + 33 * n], floats[a + 33 * n : b],
        floats[b : b + s], floats[b + s : b + 2 * s], floats[b + 2 * s : b + 3 * s],
        floats[b + 3 * s : b + 4 * s], floats[b + 4 * s : b + 5 * s], floats[b + 5 * s : b + 6 * s],
        floats[b + 6 * s : b + 7 * s], floats[b + 7 * s : d],
        floats[d : d + 4 * c], floats[d + 4 * c : d + 4 * c + 4 * o], floats[e - 6 : e],
        floats[e:f], floats[f:g], floats[g : g + p * REALS],
        flags[:n],
        unsigned[:o], unsigned[o : o + p], unsigned[o + p : o + 2 * p], unsigned[o + 2 * p : o + 3 * p], unsigned[o + 3 * p : o + 4 * p],
        signed[:HEADER], signed[HEADER : HEADER + p], signed[HEADER + p : HEADER + 2 * p], signed[HEADER + 2 * p : h],
        signed[h : h + p * NUMBERS], signed[h + p * NUMBERS : h + 2 * p * NUMBERS],
    )  # fmt: skip
