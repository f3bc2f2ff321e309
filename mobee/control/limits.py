"""The force that keeps a motor inside its limits (thesis eqs. 5.12-5.13).  Compiled."""

from __future__ import annotations

from mobee.control.layout import ABOVE, BELOW, F_MOTOR, FELT, HIGH, I_FELT, LIMIT_WIDTH, LOW, MAX_LIMIT, MOTOR
from mobee.engine.compiled import inner_exact
from mobee.robot.robot import Array, Ints


@inner_exact
def limit_force(q: float, low: float, high: float, below: float, above: float, slope: float) -> float:
    """Zero inside [low + below, high - above], a linear ramp inward of that slope up to the limit and on beyond it (eq. 5.12).

    The slope is that of the eq., maximum / width, also where a zone is narrower than the width (`limit_zones`): then the force at the
    limit is less than the maximum.  The thesis prints the ranges wrong: continuity and the direction (inward) decide.
    """
    return slope * (max(low + below - q, 0.0) - max(q - high + above, 0.0))


@inner_exact
def limit_force_of(floats: Array, motor: int, q: float) -> float:
    """The force of one motor [rad/s^2], of a packed law."""
    o = F_MOTOR + motor * MOTOR
    slope = floats[o + MAX_LIMIT] / floats[o + LIMIT_WIDTH]
    return limit_force(q, floats[o + LOW], floats[o + HIGH], floats[o + BELOW], floats[o + ABOVE], slope)


@inner_exact
def limit_forces(integers: Ints, floats: Array, q: Array, force: Array) -> None:
    """Fill `force` (n,) with the force of every motor that is felt (eq. 5.13)."""
    for k in range(integers[FELT]):
        i = integers[integers[I_FELT] + k]
        force[i] = limit_force_of(floats, i, q[i])
