"""The way out of a pose in which the pull on a marker moves nothing (see `reach_pull`).  Compiled."""

from __future__ import annotations

import math

from mobee.control.layout import F_MOTOR, HIGH, LOW, MOTOR, UNIT
from mobee.control.marker import PackedReach, miss, place_marker
from mobee.control.reach_bend import largest
from mobee.control.reach_layout import BEFORE, CURVE, EASE, MOVED, SLOPE, WAY
from mobee.control.reach_push import slopes
from mobee.engine.compiled import inner_exact
from mobee.robot.robot import Array

BEND = 1e-3  # of the size of J E J^T: curvature that counts
PROBE = 1e-4  # rad
TURNS = 60  # of the power iteration


@inner_exact
def curve(floats: Array, reach: PackedReach, q: Array) -> float:
    """Fill how half the square of the error curves along pairs of motors, as they give way; its size."""
    motors, moved = reach.motors, reach.whole[MOVED]
    for k in range(moved):
        i = reach.pulled[k]
        here, probe = q[i], PROBE * floats[F_MOTOR + i * MOTOR + UNIT]
        for side in range(2):
            q[i] = here + (probe if side == 0 else -probe)
            place_marker(reach, q)
            miss(reach)
            slopes(reach)
            for m in range(moved):
                j = reach.pulled[m]
                motors[CURVE + k, j] = motors[SLOPE, j] if side == 0 else (motors[SLOPE, j] - motors[CURVE + k, j]) / (2.0 * PROBE)
        q[i] = here
    squares = 0.0
    for k in range(moved):
        i = reach.pulled[k]
        for m in range(k + 1):
            j = reach.pulled[m]
            both = 0.5 * (motors[CURVE + k, j] + motors[CURVE + m, i]) * math.sqrt(motors[EASE, i] * motors[EASE, j])
            motors[CURVE + k, j] = motors[CURVE + m, i] = both
            squares += both * both if k == m else 2.0 * both * both
    place_marker(reach, q)
    miss(reach)
    slopes(reach)
    return math.sqrt(squares)


@inner_exact
def find_way(floats: Array, reach: PackedReach, q: Array, size: float) -> bool:
    """From a pose that the pull does not move: the way (WAY) along which the error falls on both sides; False if there is none."""
    motors, moved = reach.motors, reach.whole[MOVED]
    shift = curve(floats, reach, q)
    for k in range(moved):
        i = reach.pulled[k]
        motors[BEFORE, i] = motors[WAY, i]
        motors[WAY, i] = 1.0 + 0.1 * k
    if largest(reach, shift, -1.0, WAY, TURNS) < BEND * size:
        for k in range(moved):
            motors[WAY, reach.pulled[k]] = 0.0
        return False
    before, middle = 0.0, 0.0
    for k in range(moved):
        i = reach.pulled[k]
        o = F_MOTOR + i * MOTOR
        before += motors[WAY, i] * motors[BEFORE, i]
        middle += motors[WAY, i] * (0.5 * (floats[o + LOW] + floats[o + HIGH]) - q[i])
    if before < 0.0 or (before == 0.0 and middle < 0.0):
        for k in range(moved):
            motors[WAY, reach.pulled[k]] = -motors[WAY, reach.pulled[k]]
    return True
