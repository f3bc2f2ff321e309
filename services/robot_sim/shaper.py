"""References that never ask the motors for more than their velocity and acceleration limits."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array
from mobee.simulation.motors import SERVO_GAIN
from services.robot_sim.limits import Limits

_WAYS = np.array([[1.0], [-1.0]])  # down, up: a position's part in the distance from that limit


class Shaper:
    """Turns commanded references into allowed ones, tick by tick; arrays (n,)."""

    def __init__(self, limits: Limits, dt: float) -> None:
        self._limits, self._dt = limits, dt
        self._ends = np.stack([-limits.lower, limits.upper])
        self._change = limits.acceleration * dt  # rad/s a tick
        self.position = np.zeros(len(limits.lower))  # rad
        self.velocity = np.zeros(len(limits.lower))  # rad/s, what is asked of the motors now

    def start(self, q: Array, velocity: Array) -> None:
        """Begin where the motors are, rad, as fast as they are, rad/s."""
        self.velocity = np.clip(velocity, -self._limits.velocity, self._limits.velocity)
        self.position = q + self.velocity / SERVO_GAIN  # so far is the reference ahead of a servo at that speed

    def to_velocity(self, wanted: Array, q: Array) -> Array:
        """The velocity to ask for now; before a position limit no more than can still be braked."""
        down, up = self._brakeable(q)
        self._approach(np.clip(wanted, -down, up))
        return self.velocity

    def runs_out(self, q: Array, velocity: Array) -> bool:
        """Whether some motor is a tick of braking too fast, rad/s, to stop before its position limit."""
        down, up = self._brakeable(q)
        return bool(((velocity > up + self._change) | (velocity < -down - self._change)).any())

    def to_position(self, wanted: Array) -> Array:
        """The position to ask for now, on the way to `wanted` and arriving there at rest."""
        rest = np.clip(wanted, self._limits.lower, self._limits.upper) - self.position
        fastest = np.minimum(self._braked_within(np.abs(rest)), np.abs(rest) / self._dt)
        self._approach(np.sign(rest) * fastest)
        self.position = self.position + self.velocity * self._dt
        return self.position

    def _brakeable(self, q: Array) -> tuple[Array, Array]:
        """The largest speeds downwards and upwards that can be braked before a limit."""
        down, up = self._braked_within(np.maximum(self._ends + _WAYS * q, 0.0))
        return down, up

    def _approach(self, velocity: Array) -> None:
        self.velocity = velocity.clip(self.velocity - self._change, self.velocity + self._change)  # exactly what is asked for, if it may be

    def _braked_within(self, distance: Array) -> Array:
        """The largest velocity that whole ticks of full braking end within the distance."""
        steps = np.sqrt(0.25 + 2.0 * distance / (self._change * self._dt)) - 0.5
        return np.minimum(self._limits.velocity, self._change * steps)
