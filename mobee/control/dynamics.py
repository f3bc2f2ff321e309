"""The dynamical system of the controller (thesis eq. 5.7), one explicit step at a time."""

from __future__ import annotations

import numpy as np

from mobee.control.gains import Gains
from mobee.control.squash import squash
from mobee.errors import InvalidValue
from mobee.robot.robot import Array


def acceleration(q: Array, velocity: Array, attractor: Array, force: Array, gains: Gains) -> Array:
    """Solve eq. 5.7 for the acceleration [rad/s^2]: squashed spring plus forces minus damping; all (n,).

    `q` rad from the encoders; `velocity` rad/s is the controller's own state, never a difference of
    encoder readings; `force` rad/s^2 is the sum of the right-hand side.
    """
    return squash(attractor - q, gains.max_spring, gains.stiffness) + force - gains.damping * velocity


def largest_step(gains: Gains) -> float:
    """The time step [s] at which the semi-implicit Euler step of the law stops being stable.

    With the stiffest spring k (attractor, limit and constraint together): C dt < 2 and k dt^2 < 4 - 2 C dt, of which the
    second is the narrower.
    """
    k = _stiffest(gains)
    return float((np.sqrt(gains.damping**2 + 4.0 * k) - gains.damping) / k)


def require_stable(gains: Gains, dt: float) -> None:
    """Raise InvalidValue if the law cannot be integrated with steps of dt [s], naming the bound that is broken."""
    if not (dt > 0 and np.isfinite(dt)):
        raise InvalidValue(f"time step {dt} s: must be a finite time above 0")
    if dt < largest_step(gains):
        return
    c, k = gains.damping, _stiffest(gains)
    broken = (
        f"damping * dt = {c * dt:.3g}, must be below 2"
        if c * dt >= 2
        else f"stiffness * dt^2 = {k * dt * dt:.3g}, must be below 4 - 2 damping dt = {4 - 2 * c * dt:.3g}"
    )
    raise InvalidValue(f"gains unstable at steps of {dt:.4g} s: {broken}. Use steps below {largest_step(gains):.4g} s or less damping.")


def _stiffest(gains: Gains) -> float:
    return gains.stiffness + gains.max_limit / gains.limit_width + gains.max_constraint / gains.constraint_width
