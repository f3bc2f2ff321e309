"""The force on a marker that brings it nearer at one RATE in every direction (see `reach_pull`).  Compiled."""

from __future__ import annotations

import math

from mobee.control.layout import ABOVE, BELOW, CLIENT_SLOPE, DAMPING, F_MOTOR, HIGH, LOW, MOTOR
from mobee.control.marker import PackedReach
from mobee.control.reach_bend import ARM, bend, bend_at_most
from mobee.control.reach_layout import COLUMN, EASE, ERROR, FORCE, GIVE, MOVED, PUSH, SLOPE, SOLVED, TURNED
from mobee.engine.compiled import inner_exact
from mobee.robot.robot import Array

RATE = 5.0  # 1/s: far below what swings with commands three ticks old at 100 Hz (docs/law.md)
SOFT = 0.03  # of the size of J E J^T: damping
SOFTER = 60  # times at most that it is doubled: more than any finite force needs
NOTHING = 1e-12  # m^2/s, what a marker gives that nothing moves


@inner_exact
def weight(row: int) -> float:
    """What a row of the Jacobian counts [m]: 1 for positions, ARM for normals."""
    return 1.0 if row < 3 else ARM


@inner_exact
def slopes(reach: PackedReach) -> None:
    """J^T error: how fast half the square of the error falls along each motor that is pulled, m^2/rad."""
    real, motors = reach.real, reach.motors
    rows = 3 + 3 * reach.whole[TURNED]
    for k in range(reach.whole[MOVED]):
        i = reach.pulled[k]
        motors[SLOPE, i] = 0.0
        for row in range(rows):
            motors[SLOPE, i] += weight(row) * weight(row) * motors[COLUMN + row, i] * real[ERROR + row]


@inner_exact
def ease_motors(floats: Array, reach: PackedReach, q: Array) -> None:
    """How fast each motor goes for a torque of 1: slope of the squash over damping; 0 for one that a limit keeps."""
    motors = reach.motors
    for k in range(reach.whole[MOVED]):
        i = reach.pulled[k]
        o = F_MOTOR + i * MOTOR
        low, high, way = floats[o + LOW] + 0.5 * floats[o + BELOW], floats[o + HIGH] - 0.5 * floats[o + ABOVE], motors[SLOPE, i]
        kept = (q[i] < low and way < 0.0) or (q[i] > high and way > 0.0)
        motors[EASE, i] = 0.0 if kept else floats[o + CLIENT_SLOPE] / floats[o + DAMPING]


@inner_exact
def give(reach: PackedReach) -> float:
    """Fill J E J^T, as it counts; its size."""
    real, motors = reach.real, reach.motors
    rows = 3 + 3 * reach.whole[TURNED]
    squares = 0.0
    for a in range(rows):
        for b in range(rows):
            total = 0.0
            for k in range(reach.whole[MOVED]):
                i = reach.pulled[k]
                total += motors[COLUMN + a, i] * motors[EASE, i] * motors[COLUMN + b, i]
            total *= weight(a) * weight(b)
            real[GIVE + 6 * a + b] = total
            squares += total * total
    return max(math.sqrt(squares), NOTHING)


@inner_exact
def solve(real: Array, rows: int, size: float, soft: float) -> None:
    """Replace PUSH by the solution of (J E J^T / size + soft) x = PUSH (Cholesky)."""
    for a in range(rows):
        for b in range(a + 1):
            total = real[GIVE + 6 * a + b] / size + (soft if a == b else 0.0)
            for c in range(b):
                total -= real[SOLVED + 6 * a + c] * real[SOLVED + 6 * b + c]
            real[SOLVED + 6 * a + b] = math.sqrt(total) if a == b else total / real[SOLVED + 6 * b + b]
    for a in range(rows):
        for c in range(a):
            real[PUSH + a] -= real[SOLVED + 6 * a + c] * real[PUSH + c]
        real[PUSH + a] /= real[SOLVED + 6 * a + a]
    for a in range(rows - 1, -1, -1):
        for c in range(a + 1, rows):
            real[PUSH + a] -= real[SOLVED + 6 * c + a] * real[PUSH + c]
        real[PUSH + a] /= real[SOLVED + 6 * a + a]


@inner_exact
def push_marker(reach: PackedReach, size: float, scale: float) -> None:
    """The force on the marker: as much in every direction as gives RATE, less where the bend of its path would make it swing."""
    real = reach.real
    rows = 3 + 3 * reach.whole[TURNED]
    soft = SOFT
    for _ in range(SOFTER):
        for row in range(rows):
            real[PUSH + row] = RATE * scale * weight(row) * real[ERROR + row] / size
        solve(real, rows, size, soft)
        if bend_at_most(reach) < RATE or bend(reach) < RATE:
            return
        soft *= 2.0


@inner_exact
def force_motors(reach: PackedReach) -> None:
    """Fill the force on the motors: J^T of that on the marker."""
    motors = reach.motors
    for k in range(reach.whole[MOVED]):
        i = reach.pulled[k]
        motors[FORCE, i] = 0.0
        for row in range(3 + 3 * reach.whole[TURNED]):
            motors[FORCE, i] += weight(row) * motors[COLUMN + row, i] * reach.real[PUSH + row]
