"""The dynamical system of the controller (thesis eq. 5.7), one semi-implicit step of one motor at a time.  Compiled."""

from __future__ import annotations

from mobee.control.squash import squash
from mobee.engine.compiled import inner_exact


@inner_exact
def acceleration(q: float, velocity: float, attractor: float, force: float, stiffness: float, max_spring: float, damping: float) -> float:
    """Solve eq. 5.7 for the acceleration [rad/s^2]: squashed spring plus forces minus damping.

    `q` rad from the encoders; `velocity` rad/s is the controller's own state, never a difference of
    encoder readings; `force` rad/s^2 is the sum of the right-hand side.
    """
    return squash(attractor - q, max_spring, stiffness) + force - damping * velocity


@inner_exact
def bounded(velocity: float, sent: float, max_speed: float, max_change: float) -> float:
    """The velocity that a motor is told [rad/s], within its speed and within `max_change` of what was sent last."""
    wanted = min(max(velocity, -max_speed), max_speed)
    return sent + min(max(wanted - sent, -max_change), max_change)


@inner_exact
def led(reference: float, q: float, velocity: float, dt: float, reach: float, low: float, high: float) -> float:
    """The position reference [rad], one step on: it waits while it is farther than `reach` ahead of a motor that is blocked."""
    lead = reference - q
    if abs(lead) > reach and lead * velocity > 0.0:
        return min(max(reference, low), high)
    return min(max(reference + velocity * dt, low), high)
