"""What holds motors back while they draw a marker, as a wall along which it goes on (see `reach_pull`).  Compiled."""

from __future__ import annotations

import math

from mobee.control.layout import F_MOTOR, MOTOR, UNIT
from mobee.control.limits import limit_force_of
from mobee.control.marker import PackedReach
from mobee.control.reach_layout import AWAY, COLUMN, EASE, FORCE, GIVE, HELD, LIMITED, MOVED, TURNED
from mobee.control.reach_push import force_motors, give, push_marker, weight
from mobee.engine.compiled import inner_exact
from mobee.robot.robot import Array

WALL = 0.5  # rad/s^2: what holds the motors back half counts as a wall where it is that strong


@inner_exact
def held_back(floats: Array, reach: PackedReach, q: Array, against: Array) -> bool:
    """Split what acts against the force (LIMITED, of each motor alone; HELD, the rest); whether any of it does."""
    motors = reach.motors
    speed, limited = 0.0, False
    for k in range(reach.whole[MOVED]):
        i = reach.pulled[k]
        limit, unit = limit_force_of(floats, i, q[i]), floats[F_MOTOR + i * MOTOR + UNIT]
        motors[LIMITED, i] = abs(limit) / unit if limit * motors[FORCE, i] < 0.0 else 0.0
        motors[HELD, i] = (against[i] - limit) / unit
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
