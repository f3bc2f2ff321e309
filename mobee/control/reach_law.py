"""The reach laws: a marker is drawn to a target by the motors of a part, against its attractor (thesis 8.2).  Compiled.

Published: J^T f with f as strong as the marker is far, bounded as a client's force; the spring pulls back all the while.
Default: see `reacher`; the spring gives way while the reach lasts.
"""

from __future__ import annotations

import math

from mobee.control.client import share
from mobee.control.layout import CLIENT_SLOPE, DIRECTION, F_MOTOR, MAX_CLIENT, MOTOR, PUBLISHED, UNIT
from mobee.control.marker import PackedReach, miss, place_marker
from mobee.control.reach_layout import (
    COLUMN,
    ERROR,
    FACING,
    FIRST,
    FORCE,
    MISSING,
    MOVED,
    TURNED,
    WANTED,
)
from mobee.control.reach_pull import add_release, nears, pull_marker
from mobee.control.squash import squash
from mobee.engine.compiled import entry_exact, inner_exact
from mobee.robot.robot import Array, Ints

FORCE_GAIN = math.radians(5000.0)  # rad/s^2 for a lever and a distance of 1 m; the 2014 program's 5000 are deg/s^2
TORQUE_GAIN = math.radians(5000.0)  # the same, half of it at a right angle, all of it where the normal points the other way


@inner_exact
def published_force(reach: PackedReach) -> None:
    """J^T f, before it is bounded, in rad/s^2."""
    real, motors = reach.real, reach.motors
    twist = 0.0
    if reach.whole[TURNED] == 1:
        along = real[FACING] * real[WANTED] + real[FACING + 1] * real[WANTED + 1] + real[FACING + 2] * real[WANTED + 2]
        twist = TORQUE_GAIN * real[MISSING] * 0.5 * (1.0 - along)
    for k in range(reach.whole[MOVED]):
        i = reach.pulled[k]
        force = 0.0
        for row in range(3):
            force += FORCE_GAIN * motors[COLUMN + row, i] * real[ERROR + row] + twist * motors[COLUMN + 3 + row, i] * real[ERROR + 3 + row]
        motors[FORCE, i] = force


@inner_exact
def add_bounded(integers: Ints, floats: Array, reach: PackedReach, total: Array) -> None:
    """Add L(f) as of a client (see `add_client_force`), of the motors that are pulled."""
    force, count = reach.motors[FORCE], reach.whole[MOVED]
    if integers[DIRECTION] == 0:
        for k in range(count):
            i = reach.pulled[k]
            o = F_MOTOR + i * MOTOR
            total[i] += squash(force[i] * floats[o + UNIT], floats[o + MAX_CLIENT], floats[o + CLIENT_SLOPE])
        return
    squares = 0.0
    for k in range(count):
        squares += force[reach.pulled[k]] * force[reach.pulled[k]]
    length, most = math.sqrt(squares), math.inf
    for k in range(count):
        most = min(most, share(floats, reach.pulled[k], length))
    for k in range(count):
        i = reach.pulled[k]
        total[i] += most * force[i] * floats[F_MOTOR + i * MOTOR + UNIT]


@inner_exact
def add_reach(integers: Ints, floats: Array, reach: PackedReach, q: Array, attractor: Array, dt: float, total: Array) -> None:
    """Add the force of a reach at the measured q (n,) rad to `total` (n,) in rad/s^2."""
    place_marker(reach, q)
    miss(reach)
    if integers[PUBLISHED] == 1:
        published_force(reach)
        add_bounded(integers, floats, reach, total)
        return
    nudged = pull_marker(floats, reach, q, dt, total)
    add_bounded(integers, floats, reach, total)
    add_release(floats, reach, nudged, q, attractor, total)


@inner_exact
def reach_of(reaches: PackedReach, r: int) -> PackedReach:
    """One of them.  Only for functions that do not count references: its views are not counted."""
    return PackedReach(reaches.whole[r], reaches.pulled[r], reaches.driven[r], reaches.real[r], reaches.chain[r], reaches.motors[r])


@inner_exact
def add_all(integers: Ints, floats: Array, reaches: PackedReach, q: Array, attractor: Array, dt: float, total: Array) -> None:
    """Add the forces of all reaches at the measured q (n,) rad to `total` (n,) in rad/s^2."""
    for r in range(len(reaches.whole)):
        add_reach(integers, floats, reach_of(reaches, r), q, attractor, dt, total)


@inner_exact
def goes_on(integers: Ints, reaches: PackedReach, first: int) -> bool:
    """Whether the part that begins with that motor reaches, and goes on although it has settled; never under the published law."""
    for r in range(len(reaches.whole)):
        if reaches.whole[r, FIRST] == first:
            return integers[PUBLISHED] == 0 and nears(reach_of(reaches, r))
    return False


@entry_exact(
    "void(int64[::1], float64[::1], float64[::1], float64[::1], float64, float64[::1], "
    "int64[:,::1], int64[:,::1], int64[:,:,::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1])"
)
def add_reaches(
    integers: Ints,
    floats: Array,
    q: Array,
    attractor: Array,
    dt: float,
    total: Array,
    whole: Ints,
    pulled: Ints,
    driven: Ints,
    real: Array,
    chain: Array,
    motors: Array,
) -> None:
    """`add_all`, for Python."""
    add_all(integers, floats, PackedReach(whole, pulled, driven, real, chain, motors), q, attractor, dt, total)


@entry_exact("boolean(int64[::1], int64, int64[:,::1], int64[:,::1], int64[:,:,::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1])")
def still_nears(integers: Ints, first: int, whole: Ints, pulled: Ints, driven: Ints, real: Array, chain: Array, motors: Array) -> bool:
    """`goes_on`, for Python."""
    return goes_on(integers, PackedReach(whole, pulled, driven, real, chain, motors), first)
