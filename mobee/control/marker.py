"""Where the marker of a reach is at a pose, and how each motor that is pulled moves it (thesis eq. 5.1).  Compiled.

What is rigid between two ticks is not computed again, to the same result: a joint's sine and cosine while its angle is the same, and
the frames in front of the first joint that has moved.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from mobee.control.reach_layout import (
    ANGLE,
    AT,
    AXIS,
    COLUMN,
    COSINE,
    DRIVEN_BY,
    ERROR,
    FACING,
    FRAME,
    JOINTS,
    LINK,
    MISSING,
    MOTION,
    MOVED,
    NORMAL,
    OFFSET,
    PIVOT,
    POINT,
    PULLED,
    RADIUS,
    SEEN_FROM,
    SINE,
    SLIDES,
    SURFACE,
    TARGET,
    TURNED,
    USED,
    WANTED,
)
from mobee.engine.compiled import inner_exact
from mobee.robot.robot import Array, Ints


class PackedReach(NamedTuple):
    """One reach: see `reach_layout`; `pulled` (moved,): the motors, `driven` and `chain`: the joints, `motors` (ROWS, n).

    Of all reaches under way every array has one more axis, the first; `reach_law.reach_of` takes one out.
    """

    whole: Ints
    pulled: Ints
    driven: Ints
    real: Array
    chain: Array
    motors: Array


@inner_exact
def spin(chain: Array, j: int, x: float, y: float, z: float, sine: float) -> tuple[float, float, float]:
    """Turn a vector about joint j's axis, by an angle of that sine and of the joint's cosine."""
    u, v, w = chain[j, AXIS], chain[j, AXIS + 1], chain[j, AXIS + 2]
    a, b, c = v * z - w * y, w * x - u * z, u * y - v * x
    rest = 1.0 - chain[j, COSINE]
    return (
        x + sine * a + rest * (v * c - w * b),
        y + sine * b + rest * (w * a - u * c),
        z + sine * c + rest * (u * b - v * a),
    )


@inner_exact
def carried(chain: Array, j: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A vector in the frame of what carries joint j, in the root frame."""
    o = FRAME
    return (
        chain[j, o] * x + chain[j, o + 1] * y + chain[j, o + 2] * z,
        chain[j, o + 3] * x + chain[j, o + 4] * y + chain[j, o + 5] * z,
        chain[j, o + 6] * x + chain[j, o + 7] * y + chain[j, o + 8] * z,
    )


@inner_exact
def bend_joints(reach: PackedReach, q: Array) -> int:
    """Bring the joints to q (n,) rad; the first that has moved since the last pose."""
    chain, driven = reach.chain, reach.driven
    first: int = reach.whole[JOINTS]
    for j in range(reach.whole[JOINTS] - 1, -1, -1):
        angle = chain[j, OFFSET]
        for k in range(reach.driven.shape[1] - DRIVEN_BY):
            angle += chain[j, LINK + k] * q[driven[j, DRIVEN_BY + k]]
        if angle != chain[j, ANGLE]:
            first = j
            chain[j, ANGLE] = angle
            chain[j, SINE], chain[j, COSINE] = (0.0, 1.0) if driven[j, SLIDES] == 1 else (math.sin(angle), math.cos(angle))
    return first


@inner_exact
def see_marker(reach: PackedReach) -> None:
    """From the marker down to the base: where it is in the frame of what carries each joint, and in the root frame."""
    chain, real = reach.chain, reach.real
    x, y, z = real[POINT], real[POINT + 1], real[POINT + 2]
    for j in range(reach.whole[JOINTS] - 1, -1, -1):
        if reach.driven[j, SLIDES] == 1:
            way = chain[j, ANGLE]
            x, y, z = x + way * chain[j, AXIS], y + way * chain[j, AXIS + 1], z + way * chain[j, AXIS + 2]
        else:
            px, py, pz = chain[j, PIVOT], chain[j, PIVOT + 1], chain[j, PIVOT + 2]
            x, y, z = spin(chain, j, x - px, y - py, z - pz, chain[j, SINE])
            x, y, z = x + px, y + py, z + pz
        chain[j, SEEN_FROM], chain[j, SEEN_FROM + 1], chain[j, SEEN_FROM + 2] = x, y, z
    real[AT], real[AT + 1], real[AT + 2] = x, y, z


@inner_exact
def turn_frames(reach: PackedReach, first: int) -> None:
    """From the base up, behind the first joint that has moved: the frames in front of each joint."""
    chain = reach.chain
    for j in range(first, reach.whole[USED] - 1):
        for row in range(FRAME, FRAME + 9, 3):
            turned = chain[j, row], chain[j, row + 1], chain[j, row + 2]
            if reach.driven[j, SLIDES] == 0:
                turned = spin(chain, j, turned[0], turned[1], turned[2], -chain[j, SINE])
            chain[j + 1, row], chain[j + 1, row + 1], chain[j + 1, row + 2] = turned


@inner_exact
def face(reach: PackedReach) -> None:
    """The marker's normal, root frame."""
    real = reach.real
    x, y, z = real[NORMAL], real[NORMAL + 1], real[NORMAL + 2]
    for j in range(reach.whole[JOINTS] - 1, -1, -1):
        if reach.driven[j, SLIDES] == 0:
            x, y, z = spin(reach.chain, j, x, y, z, reach.chain[j, SINE])
    real[FACING], real[FACING + 1], real[FACING + 2] = x, y, z


@inner_exact
def place_marker(reach: PackedReach, q: Array) -> None:
    """Bring the marker, and the columns of the motors that are pulled, to q (n,) rad."""
    chain, motors, whole = reach.chain, reach.motors, reach.whole
    first = bend_joints(reach, q)
    see_marker(reach)
    turn_frames(reach, first)
    if whole[TURNED] == 1:
        face(reach)
    for k in range(whole[MOVED]):
        for row in range(COLUMN, COLUMN + 6):
            motors[row, reach.pulled[k]] = 0.0
    drives = reach.driven.shape[1] - DRIVEN_BY
    for j in range(whole[USED]):
        if reach.driven[j, PULLED] == 0:
            continue
        u, v, w = carried(chain, j, chain[j, AXIS], chain[j, AXIS + 1], chain[j, AXIS + 2])
        d, e, f = carried(
            chain, j, chain[j, SEEN_FROM] - chain[j, PIVOT], chain[j, SEEN_FROM + 1] - chain[j, PIVOT + 1],
            chain[j, SEEN_FROM + 2] - chain[j, PIVOT + 2],
        )  # fmt: skip
        if reach.driven[j, SLIDES] == 1:
            chain[j, MOTION], chain[j, MOTION + 1], chain[j, MOTION + 2] = u, v, w
        else:
            chain[j, MOTION], chain[j, MOTION + 1], chain[j, MOTION + 2] = v * f - w * e, w * d - u * f, u * e - v * d
            chain[j, MOTION + 3], chain[j, MOTION + 4], chain[j, MOTION + 5] = u, v, w
        for k in range(drives):
            i, scale = reach.driven[j, DRIVEN_BY + k], chain[j, LINK + drives + k]
            for row in range(6):
                motors[COLUMN + row, i] += scale * chain[j, MOTION + row]


@inner_exact
def miss(reach: PackedReach) -> None:
    """What is missing, toward the target or its surface, and the axis about which the normal is to turn."""
    real = reach.real
    square = 0.0
    for k in range(3):
        real[ERROR + k] = real[TARGET + k] - real[AT + k]
        square += real[ERROR + k] * real[ERROR + k]
    distance = math.sqrt(square)
    if reach.whole[SURFACE] == 1:
        outside = max(distance - real[RADIUS], 0.0)
        for k in range(3):
            real[ERROR + k] *= outside / distance if distance > 0.0 else 0.0
        distance = outside
    real[MISSING] = distance
    if reach.whole[TURNED] == 1:
        x, y, z = real[FACING], real[FACING + 1], real[FACING + 2]
        real[ERROR + 3] = y * real[WANTED + 2] - z * real[WANTED + 1]
        real[ERROR + 4] = z * real[WANTED] - x * real[WANTED + 2]
        real[ERROR + 5] = x * real[WANTED + 1] - y * real[WANTED]
