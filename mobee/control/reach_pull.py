"""The default reach law: the marker comes nearer at one RATE in every direction, wherever the arm is.  Compiled.

J^T control swings where commands are late and stops in singular poses (thesis 5.1); see `reacher` for why, and for what is done.
What holds the motors back, limits, clauses or contacts, is a wall along which the marker goes on.
"""

from __future__ import annotations

import math

from mobee.control.layout import F_MOTOR, MAX_SPRING, MOTOR, STIFFNESS, UNIT
from mobee.control.marker import PackedReach
from mobee.control.reach_layout import BEGUN, BEST, EASE, ERROR, LEFT, MOVED, SEEN, SINCE, SLOPE, TURNED, WAY
from mobee.control.reach_push import ease_motors, force_motors, give, push_marker, slopes, weight
from mobee.control.reach_wall import held_back, slide
from mobee.control.reach_way import find_way
from mobee.control.squash import squash
from mobee.engine.compiled import inner_exact
from mobee.robot.robot import Array

LONGEST = 0.2  # m: beyond it the pull grows no more
TOLERANCE = 2e-3  # m
WEAK = 0.05  # of the error's force that arrives at the motors: below it the pose is singular, or as near as possible
NUDGE = 0.1  # rad, out of a singular pose
SMOOTH = 0.25  # s, over which the error is averaged before it is judged
PATIENCE = 3.0  # s without coming nearer: no way out is tried any more
WAIT = 0.6  # s: what has come nearer since has not arrived
BETTER = 5e-4  # m, that count as nearer


@inner_exact
def note_missing(reach: PackedReach, dt: float) -> float:
    """Average the error over SMOOTH, keep for how long it has not become less; what is missing [m]."""
    real = reach.real
    share = min(1.0, dt / SMOOTH) if real[BEGUN] == 1.0 else 1.0
    squares = 0.0
    for row in range(3 + 3 * reach.whole[TURNED]):
        real[SEEN + row] += (weight(row) * real[ERROR + row] - real[SEEN + row]) * share
        squares += real[SEEN + row] * real[SEEN + row]
    missing = math.sqrt(squares)
    if real[BEGUN] == 0.0 or missing < real[BEST] - BETTER:
        real[BEST], real[SINCE] = missing, 0.0
    real[BEGUN] = 1.0
    real[SINCE] += dt
    real[LEFT] = missing
    return missing


@inner_exact
def pull_marker(floats: Array, reach: PackedReach, q: Array, dt: float, against: Array) -> bool:
    """Fill the force on the motors (FORCE), before it is bounded, of a marker that is in place; whether WAY leads out of this pose.

    `against` (n,) rad/s^2: what else acts on the motors than their springs.
    """
    real, motors, moved = reach.real, reach.motors, reach.whole[MOVED]
    rows = 3 + 3 * reach.whole[TURNED]
    missing = note_missing(reach, dt)
    slopes(reach)
    ease_motors(floats, reach, q)
    size = give(reach)
    squares, arriving = 0.0, 0.0
    for row in range(rows):
        squares += weight(row) * real[ERROR + row] * weight(row) * real[ERROR + row]
    for k in range(moved):
        i = reach.pulled[k]
        arriving += motors[SLOPE, i] * motors[EASE, i] * motors[SLOPE, i]
    weak = arriving < WEAK * WEAK * size * squares
    nudged = weak and missing > TOLERANCE and real[SINCE] <= PATIENCE and find_way(floats, reach, q, size)
    fading = missing / (missing + 0.5 * TOLERANCE)  # so that at the target the encoders' noise is not followed
    scale = fading / (1.0 + math.sqrt(squares) / LONGEST)
    push_marker(reach, size, scale)
    force_motors(reach)
    if held_back(floats, reach, q, against):
        slide(reach, size, scale)
    return nudged


@inner_exact
def add_release(floats: Array, reach: PackedReach, nudged: bool, q: Array, attractor: Array, total: Array) -> None:
    """Take the springs of the motors that are pulled away from `total` (n,) in rad/s^2, for others a little way along WAY.

    The attractor itself stays, and draws back when the reach has ended.
    """
    for k in range(reach.whole[MOVED]):
        i = reach.pulled[k]
        o = F_MOTOR + i * MOTOR
        total[i] -= squash(attractor[i] - q[i], floats[o + MAX_SPRING], floats[o + STIFFNESS])
        if nudged:
            total[i] += squash(NUDGE * reach.motors[WAY, i] * floats[o + UNIT], floats[o + MAX_SPRING], floats[o + STIFFNESS])


@inner_exact
def nears(reach: PackedReach) -> bool:
    """Whether the marker is not there yet and still comes nearer: then the reach is not over, however slow its motors are."""
    goes_on: bool = reach.real[LEFT] > 0.75 * TOLERANCE and reach.real[SINCE] < WAIT
    return goes_on
