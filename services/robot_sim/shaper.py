"""References that never ask the motors for more than their velocity and acceleration limits."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array
from mobee.simulation.load import compiled
from mobee.simulation.motors import SERVO_GAIN
from services.robot_sim.limits import Limits


class Shaper:
    """Turns commanded references into allowed ones, tick by tick; arrays (n,)."""

    def __init__(self, limits: Limits, dt: float) -> None:
        self._limits, self._dt, self._braking = limits, dt, compiled().braking
        self._bounds = limits.lower, limits.upper, limits.velocity, limits.acceleration * dt
        self._position = np.zeros(len(limits.lower))  # rad
        self._velocity = np.zeros(len(limits.lower))  # rad/s, what is asked of the motors now

    def start(self, q: Array, velocity: Array) -> None:
        """Begin where the motors are, rad, as fast as they are, rad/s."""
        self._velocity = np.clip(velocity, -self._limits.velocity, self._limits.velocity)
        self._position = q + self._velocity / SERVO_GAIN  # so far is the reference ahead of a servo at that speed

    def to_velocity(self, wanted: Array, q: Array) -> Array:
        """The velocity to ask for now; before a position limit no more than can still be braked."""
        self._braking.to_velocity(wanted, q, *self._bounds, self._velocity, self._dt)
        return self._velocity.copy()

    def to_position(self, wanted: Array) -> Array:
        """The position to ask for now, on the way to `wanted` and arriving there at rest."""
        self._braking.to_position(wanted, self._position, *self._bounds, self._velocity, self._dt)
        return self._position.copy()

    def runs_out(self, q: Array, velocity: Array) -> bool:
        """Whether some motor is a tick of braking too fast, rad/s, to stop before its position limit."""
        return bool(self._braking.runs_out(q, velocity, *self._bounds, self._dt))
