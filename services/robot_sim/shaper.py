"""References that never ask the motors for more than their velocity and acceleration limits."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array
from mobee.simulation.braking import Braking
from mobee.simulation.motors import SERVO_GAIN
from services.robot_sim.limits import Limits


class Shaper:
    """Turns commanded references into allowed ones, tick by tick; arrays (n,)."""

    def __init__(self, limits: Limits, dt: float) -> None:
        self._limits = limits
        self._asked = Braking(limits.lower, limits.upper, limits.velocity, limits.acceleration * dt, dt)

    def start(self, q: Array, velocity: Array) -> None:
        """Begin where the motors are, rad, as fast as they are, rad/s."""
        self._asked.velocity[:] = np.clip(velocity, -self._limits.velocity, self._limits.velocity)
        self._asked.position[:] = q + self._asked.velocity / SERVO_GAIN  # so far is the reference ahead of a servo at that speed

    def to_velocity(self, wanted: Array, q: Array) -> Array:
        """The velocity to ask for now; before a position limit no more than can still be braked."""
        self._asked.to_velocity(wanted, q)
        return self._asked.velocity.copy()

    def to_position(self, wanted: Array) -> Array:
        """The position to ask for now, on the way to `wanted` and arriving there at rest."""
        self._asked.to_position(wanted)
        return self._asked.position.copy()

    def runs_out(self, q: Array, velocity: Array) -> bool:
        """Whether some motor is a tick of braking too fast, rad/s, to stop before its position limit."""
        return self._asked.runs_out(q, velocity)
