"""How much the bend of a marker's path adds to the stiffness of the force that draws it (see `reach_pull`).  Compiled."""

from __future__ import annotations

import math

from mobee.control.marker import PackedReach
from mobee.control.reach_layout import BENT, COLUMN, CURVE, DRIVEN_BY, EASE, FORCE, LINK, MOTION, MOVED, PULLED, PUSH, SPARE, TURNED, USED
from mobee.engine.compiled import inner_exact
from mobee.robot.robot import Array

ARM = 0.1  # m: a normal that is wrong by an angle counts as a position that is wrong by this times the angle
FEW_TURNS = 12  # of the power iteration


@inner_exact
def bend_at_most(reach: PackedReach) -> float:
    """No less than `bend`, at little cost: for joints i before j the path's second derivative is the axis of i times the motion of j."""
    real, motors = reach.real, reach.motors
    levers, axes, force, twist = 0.0, 0.0, 0.0, 0.0
    for k in range(reach.whole[MOVED]):
        i = reach.pulled[k]
        for row in range(3):
            levers += motors[COLUMN + row, i] * motors[COLUMN + row, i] * motors[EASE, i]
            axes += motors[COLUMN + 3 + row, i] * motors[COLUMN + 3 + row, i] * motors[EASE, i]
    for row in range(3):
        force += real[PUSH + row] * real[PUSH + row]
        if reach.whole[TURNED] == 1:
            twist += real[PUSH + 3 + row] * real[PUSH + 3 + row]
    return math.sqrt(force * levers * axes) + ARM * math.sqrt(twist) * axes


@inner_exact
def bend_of(reach: PackedReach, a: int, b: int) -> float:
    """What the force is times the second derivative of the marker's pose along joints a, the nearer to the base, and b."""
    real, chain = reach.real, reach.chain
    u, v, w = chain[a, MOTION + 3], chain[a, MOTION + 4], chain[a, MOTION + 5]
    found = 0.0
    for part in range(2 if reach.whole[TURNED] == 1 and a != b else 1):
        o = MOTION + 3 * part
        x, y, z = chain[b, o], chain[b, o + 1], chain[b, o + 2]
        p, q, r = real[PUSH + 3 * part], real[PUSH + 3 * part + 1], real[PUSH + 3 * part + 2]
        found += (1.0 if part == 0 else 0.5 * ARM) * (p * (v * z - w * y) + q * (w * x - u * z) + r * (u * y - v * x))
    return found


@inner_exact
def bend(reach: PackedReach) -> float:
    """What the bend of the marker's path adds to the stiffness of the force at most, along any motion, as the motors give way."""
    motors, moved, chain = reach.motors, reach.whole[MOVED], reach.chain
    drives = reach.driven.shape[1] - DRIVEN_BY
    for k in range(moved):
        for m in range(moved):
            motors[CURVE + k, reach.pulled[m]] = 0.0
        motors[SPARE, reach.pulled[k]] = k
    for a in range(reach.whole[USED]):
        for b in range(a, reach.whole[USED]):
            if reach.driven[a, PULLED] == 0 or reach.driven[b, PULLED] == 0:
                continue
            along = bend_of(reach, a, b)
            for c in range(drives):
                for d in range(drives):
                    i, j = reach.driven[a, DRIVEN_BY + c], reach.driven[b, DRIVEN_BY + d]
                    both = chain[a, LINK + drives + c] * chain[b, LINK + drives + d]
                    if both != 0.0:
                        add_pair(motors, i, j, -along * both * math.sqrt(motors[EASE, i] * motors[EASE, j]), a != b)
    squares = 0.0
    for k in range(moved):
        for m in range(moved):
            squares += motors[CURVE + k, reach.pulled[m]] * motors[CURVE + k, reach.pulled[m]]
        motors[BENT, reach.pulled[k]] = 1.0 + 0.1 * k
    return largest(reach, math.sqrt(squares), 1.0, BENT, FEW_TURNS)


@inner_exact
def add_pair(motors: Array, i: int, j: int, value: float, twice: bool) -> None:
    """Add to the matrix at (i, j), and at (j, i) where that is another pair of joints."""
    motors[CURVE + int(motors[SPARE, i]), j] += value
    if twice:
        motors[CURVE + int(motors[SPARE, j]), i] += value


@inner_exact
def largest(reach: PackedReach, shift: float, sign: float, row: int, turns: int) -> float:
    """The largest eigenvalue of the matrix times `sign`, all of them within +-`shift`; its vector in that row, where it starts."""
    motors, moved = reach.motors, reach.whole[MOVED]
    length = 0.0
    for _ in range(turns):
        squares = 0.0
        for k in range(moved):
            i = reach.pulled[k]
            motors[FORCE, i] = shift * motors[row, i]
            for m in range(moved):
                motors[FORCE, i] += sign * motors[CURVE + k, reach.pulled[m]] * motors[row, reach.pulled[m]]
            squares += motors[FORCE, i] * motors[FORCE, i]
        length = math.sqrt(squares)
        for k in range(moved):
            i = reach.pulled[k]
            motors[row, i] = motors[FORCE, i] / length if length > 0.0 and motors[EASE, i] > 0.0 else 0.0
    return length - shift
