"""The default reach law: the marker comes nearer at one RATE in every direction, wherever the arm is.  Compiled.

J^T control swings where commands are late and stops in singular poses (thesis 5.1); see `reacher` for why, and for what is done.
What holds the motors back, limits, clauses or contacts, is a wall along which the marker goes on.
"""

from __future__ import annotations

import math

from mobee.control.layout import (
    CLIENT_SLOPE,
    DAMPING,
    F_MOTOR,
    HIGH,
    LIMIT_WIDTH,
    LOW,
    MAX_LIMIT,
    MAX_SPRING,
    MOTOR,
    STIFFNESS,
)
from mobee.control.limits import limit_force
from mobee.control.marker import PackedReach, miss, place_marker
from mobee.control.reach_layout import (
    AWAY,
    BEFORE,
    BEGUN,
    BENT,
    BEST,
    COLUMN,
    CURVE,
    DRIVEN_BY,
    EASE,
    ERROR,
    FORCE,
    GIVE,
    HELD,
    LEFT,
    LIMITED,
    LINK,
    MOTION,
    MOVED,
    PULLED,
    PUSH,
    SEEN,
    SINCE,
    SLOPE,
    SOLVED,
    SPARE,
    TURNED,
    USED,
    WAY,
)
from mobee.control.squash import squash
from mobee.engine.compiled import inner_exact
from mobee.robot.robot import Array

WALL = 0.5  # rad/s^2: what holds the motors back half counts as a wall where it is that strong
ARM = 0.1  # m: a normal that is wrong by an angle counts as a position that is wrong by this times the angle
RATE = 5.0  # 1/s: far below what swings with commands three ticks old at 100 Hz (docs/law.md)
LONGEST = 0.2  # m: beyond it the pull grows no more
SOFT = 0.03  # of the size of J E J^T: damping
SOFTER = 60  # times at most that it is doubled: more than any finite force needs
TOLERANCE = 2e-3  # m
WEAK = 0.05  # of the error's force that arrives at the motors: below it the pose is singular, or as near as possible
NUDGE = 0.1  # rad, out of a singular pose
BEND = 1e-3  # of the size of J E J^T: curvature that counts
SMOOTH = 0.25  # s, over which the error is averaged before it is judged
PATIENCE = 3.0  # s without coming nearer: no way out is tried any more
WAIT = 0.6  # s: what has come nearer since has not arrived
BETTER = 5e-4  # m, that count as nearer
PROBE = 1e-4  # rad
TURNS, FEW_TURNS = 60, 12  # of the power iteration
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
        room = 0.5 * floats[o + LIMIT_WIDTH]
        low, high, way = floats[o + LOW] + room, floats[o + HIGH] - room, motors[SLOPE, i]
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
def curve(reach: PackedReach, q: Array) -> float:
    """Fill how half the square of the error curves along pairs of motors, as they give way; its size."""
    motors, moved = reach.motors, reach.whole[MOVED]
    for k in range(moved):
        i = reach.pulled[k]
        here = q[i]
        for side in range(2):
            q[i] = here + (PROBE if side == 0 else -PROBE)
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
    shift = curve(reach, q)
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
def force_motors(reach: PackedReach) -> None:
    """Fill the force on the motors: J^T of that on the marker."""
    motors = reach.motors
    for k in range(reach.whole[MOVED]):
        i = reach.pulled[k]
        motors[FORCE, i] = 0.0
        for row in range(3 + 3 * reach.whole[TURNED]):
            motors[FORCE, i] += weight(row) * motors[COLUMN + row, i] * reach.real[PUSH + row]


@inner_exact
def held_back(floats: Array, reach: PackedReach, q: Array, against: Array) -> bool:
    """Split what acts against the force (LIMITED, of each motor alone; HELD, the rest); whether any of it does."""
    motors = reach.motors
    speed, limited = 0.0, False
    for k in range(reach.whole[MOVED]):
        i = reach.pulled[k]
        o = F_MOTOR + i * MOTOR
        limit = limit_force(q[i], floats[o + LOW], floats[o + HIGH], floats[o + LIMIT_WIDTH], floats[o + MAX_LIMIT])
        motors[LIMITED, i] = abs(limit) if limit * motors[FORCE, i] < 0.0 else 0.0
        motors[HELD, i] = against[i] - limit
        limited = limited or motors[LIMITED, i] > 0.0
        speed -= motors[HELD, i] * motors[EASE, i] * motors[FORCE, i]
    return limited or speed > 0.0


@inner_exact
def face_wall(reach: PackedReach) -> float:
    """Take HELD as a direction in which the motors give no way, the less the weaker it is; how much of it is taken."""
    real, motors, moved = reach.real, reach.motors, reach.whole[MOVED]
    rows = 3 + 3 * reach.whole[TURNED]
    squares, across = 0.0, 0.0
    for k in range(moved):
        i = reach.pulled[k]
        squares += motors[HELD, i] * motors[HELD, i]
        across += motors[HELD, i] * motors[EASE, i] * motors[HELD, i]
    if across == 0.0:
        return 0.0
    length = math.sqrt(squares)
    share = length / (length + WALL) / across
    for row in range(rows):
        real[AWAY + row] = 0.0
        for k in range(moved):
            i = reach.pulled[k]
            real[AWAY + row] += weight(row) * motors[COLUMN + row, i] * motors[EASE, i] * motors[HELD, i]
    for a in range(rows):
        for b in range(rows):
            real[GIVE + 6 * a + b] -= share * real[AWAY + a] * real[AWAY + b]
    return share


@inner_exact
def slide(reach: PackedReach, size: float, scale: float) -> None:
    """Fill the forces again for motors that are held back: along the wall, not into it."""
    motors, moved = reach.motors, reach.whole[MOVED]
    before = 0.0
    for k in range(moved):
        i = reach.pulled[k]
        before += motors[HELD, i] * motors[EASE, i] * motors[FORCE, i]
        motors[EASE, i] *= WALL / (WALL + motors[LIMITED, i])
    give(reach)
    share = face_wall(reach) if before < 0.0 else 0.0
    push_marker(reach, size, scale)
    force_motors(reach)
    speed = 0.0
    for k in range(moved):
        i = reach.pulled[k]
        speed += motors[HELD, i] * motors[EASE, i] * motors[FORCE, i]
    for k in range(moved):
        i = reach.pulled[k]
        motors[FORCE, i] = (motors[FORCE, i] - share * speed * motors[HELD, i]) * WALL / (WALL + motors[LIMITED, i])


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
            total[i] += squash(NUDGE * reach.motors[WAY, i], floats[o + MAX_SPRING], floats[o + STIFFNESS])


@inner_exact
def nears(reach: PackedReach) -> bool:
    """Whether the marker is not there yet and still comes nearer: then the reach is not over, however slow its motors are."""
    goes_on: bool = reach.real[LEFT] > 0.75 * TOLERANCE and reach.real[SINCE] < WAIT
    return goes_on
