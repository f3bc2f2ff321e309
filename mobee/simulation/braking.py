"""References that never ask motors for more than their velocity and acceleration, and never for what cannot be braked.  Compiled.

All arrays (n,): `lower`, `upper` rad, `fastest` rad/s, `change` rad/s a tick; `velocity` rad/s is what is asked for now, and is advanced.
"""

from __future__ import annotations

import math

from mobee.engine.compiled import entry_exact, inner_exact
from mobee.robot.robot import Array


@inner_exact
def braked_within(distance: float, change: float, fastest: float, dt: float) -> float:
    """The largest velocity that whole ticks of full braking end within the distance."""
    return min(fastest, change * (math.sqrt(0.25 + 2.0 * distance / (change * dt)) - 0.5))


@inner_exact
def approached(wanted: float, velocity: float, change: float) -> float:
    """A tick nearer to the wanted velocity, and exactly there if it may be."""
    return min(max(wanted, velocity - change), velocity + change)


@entry_exact("void(float64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64)")
def to_velocity(wanted: Array, q: Array, lower: Array, upper: Array, fastest: Array, change: Array, velocity: Array, dt: float) -> None:
    """Approach the wanted velocities; before a position limit no more than can still be braked."""
    for i in range(len(q)):
        down = braked_within(max(q[i] - lower[i], 0.0), change[i], fastest[i], dt)
        up = braked_within(max(upper[i] - q[i], 0.0), change[i], fastest[i], dt)
        velocity[i] = approached(min(max(wanted[i], -down), up), velocity[i], change[i])


@entry_exact("void(float64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64)")
def to_position(wanted: Array, at: Array, lower: Array, upper: Array, fastest: Array, change: Array, velocity: Array, dt: float) -> None:
    """Advance the positions `at` that are asked for, rad, on the way to the wanted ones, to arrive there at rest."""
    for i in range(len(at)):
        rest = min(max(wanted[i], lower[i]), upper[i]) - at[i]
        speed = min(braked_within(abs(rest), change[i], fastest[i], dt), abs(rest) / dt)
        velocity[i] = approached(math.copysign(speed, rest), velocity[i], change[i])
        at[i] += velocity[i] * dt


@entry_exact("boolean(float64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64[::1], float64)")
def runs_out(q: Array, moving: Array, lower: Array, upper: Array, fastest: Array, change: Array, dt: float) -> bool:
    """Whether some motor that moves so, rad/s, is a tick of braking too fast to stop before its position limit."""
    for i in range(len(q)):
        down = braked_within(max(q[i] - lower[i], 0.0), change[i], fastest[i], dt)
        up = braked_within(max(upper[i] - q[i], 0.0), change[i], fastest[i], dt)
        if moving[i] > up + change[i] or moving[i] < -down - change[i]:
            return True
    return False
