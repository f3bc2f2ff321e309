"""The force that keeps a motor inside its limits (thesis eqs. 5.12-5.13).  Compiled."""

from __future__ import annotations

from mobee.control.layout import F_MOTOR, FELT, HIGH, I_FELT, LIMIT_WIDTH, LOW, MAX_LIMIT, MOTOR
from mobee.engine.compiled import inner_exact
from mobee.robot.robot import Array, Ints


@inner_exact
def limit_force(q: float, low: float, high: float, width: float, maximum: float) -> float:
    """Zero inside [low + width, high - width], a linear ramp inward to `maximum` at the limit and on beyond it (eq. 5.12).

    Angles in rad, forces in rad/s^2.  The thesis prints the ranges wrong: continuity and the direction (inward) decide.  Where a
    motor's range is narrower than two widths the two ramps add up, to zero in the middle.
    """
    below = max(low + width - q, 0.0)
    above = max(q - high + width, 0.0)
    return maximum / width * (below - above)


@inner_exact
def limit_forces(integers: Ints, floats: Array, q: Array, force: Array) -> None:
    """Fill `force` (n,) with the force of every motor that is felt (eq. 5.13)."""
    for k in range(integers[FELT]):
        i = integers[integers[I_FELT] + k]
        o = F_MOTOR + i * MOTOR
        force[i] = limit_force(q[i], floats[o + LOW], floats[o + HIGH], floats[o + LIMIT_WIDTH], floats[o + MAX_LIMIT])
