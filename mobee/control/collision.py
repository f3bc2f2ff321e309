"""The force that drives fields out of each other (thesis eq. 5.11): f_coll = L(sum over contacts of J^T f).  Compiled."""

from __future__ import annotations

import math

from mobee.control.layout import CONTACT_GAIN, CONTACT_SLOPE, F_MOTOR, I_PART, MAX_CONTACT, MOTOR, PARTS, PUBLISHED, TOUCH, UNIT
from mobee.control.squash import norm, squash_norm
from mobee.engine.compiled import inner_exact
from mobee.robot.robot import Array, Ints


@inner_exact
def collision_forces(integers: Ints, floats: Array, torque: Array, force: Array) -> None:
    """Fill `force` (n,) in rad/s^2 from `torque`, the sum of J^T d (n,); its norm is bounded part by part (eq. 5.8).

    A motor that slides counts in its UNIT: as one that turns with a lever of UNIT m.
    """
    if integers[TOUCH] == 0:
        return
    for part in range(integers[PARTS]):
        first, stop = integers[integers[I_PART] + 2 * part], integers[integers[I_PART] + 2 * part + 1]
        touched = False
        for i in range(first, stop):
            force[i] = floats[CONTACT_GAIN] * torque[i] * floats[F_MOTOR + i * MOTOR + UNIT]
            touched = touched or force[i] != 0.0
        if not touched:
            continue
        if integers[PUBLISHED] == 1:
            square_2014(force, first, stop)
        squash_norm(force, first, stop, floats[MAX_CONTACT], floats[CONTACT_SLOPE])
        for i in range(first, stop):
            force[i] *= floats[F_MOTOR + i * MOTOR + UNIT]


@inner_exact
def square_2014(force: Array, first: int, stop: int) -> None:
    """The published law is quadratic in the penetration, in degrees; the default one is linear until it is bounded."""
    length = norm(force, first, stop)
    for i in range(first, stop):
        force[i] = math.radians(length * force[i])
