"""What a client adds: f_config, a force on motors (thesis eq. 5.9), and f_work, forces on markers (eq. 5.10).  Compiled."""

from __future__ import annotations

import math

from mobee.control.layout import CLIENT_SLOPE, DIRECTION, F_MOTOR, FELT, I_FELT, I_PART, MAX_CLIENT, MOTOR, PARTS, UNIT
from mobee.control.squash import squash
from mobee.engine.compiled import inner_exact
from mobee.robot.robot import Array, Ints


@inner_exact
def add_client_force(integers: Ints, floats: Array, f: Array, total: Array) -> None:
    """Add L(f) to `total`, both (n,) in rad/s^2: each motor by itself, or keeping the direction of f in each part."""
    if integers[DIRECTION] == 0:
        for k in range(integers[FELT]):
            i = integers[integers[I_FELT] + k]
            o = F_MOTOR + i * MOTOR
            total[i] += squash(f[i], floats[o + MAX_CLIENT], floats[o + CLIENT_SLOPE])
        return
    for part in range(integers[PARTS]):
        first, stop = integers[integers[I_PART] + 2 * part], integers[integers[I_PART] + 2 * part + 1]
        squares = 0.0
        for i in range(first, stop):
            angle = f[i] / floats[F_MOTOR + i * MOTOR + UNIT]
            squares += angle * angle
        length, narrowest = math.sqrt(squares), first
        for i in range(first, stop):
            if share(floats, i, length) < share(floats, narrowest, length):
                narrowest = i
        o = F_MOTOR + narrowest * MOTOR
        maximum, slope = floats[o + MAX_CLIENT] / floats[o + UNIT], floats[o + CLIENT_SLOPE]
        for i in range(first, stop):
            total[i] += maximum * f[i] / (maximum / slope + length)


@inner_exact
def share(floats: Array, motor: int, length: float) -> float:
    """What a motor's maximum and slope leave of a force of that norm [rad/s^2]: the smallest of a part's counts for all of it."""
    o = F_MOTOR + motor * MOTOR
    maximum = floats[o + MAX_CLIENT] / floats[o + UNIT]
    return maximum / (maximum / floats[o + CLIENT_SLOPE] + length)
