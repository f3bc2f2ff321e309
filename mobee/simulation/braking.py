"""References that never ask motors for more than their velocity and acceleration, and never for what cannot be braked."""

from __future__ import annotations

import ctypes

import numpy as np

from mobee._core import address
from mobee._core import plant as core
from mobee._core.tables import numbers
from mobee.robot.robot import Array


class Braking:
    """What is asked of motors, tick by tick; all arrays (n,).

    `velocity` rad/s and `position` rad are what is asked for now; both are changed in place.
    """

    def __init__(self, lower: Array, upper: Array, fastest: Array, change: Array, dt: float) -> None:
        """`lower` and `upper` rad, `fastest` rad/s, `change` rad/s in a tick of dt [s]."""
        self._bounds = [np.array(one, dtype=np.float64) for one in (lower, upper, fastest, change)]
        self._count = len(self._bounds[0])
        self.velocity, self.position = np.zeros(self._count), np.zeros(self._count)
        self._struct = core.Braking(self._count, *(address(one) for one in (*self._bounds, self.velocity)), dt)
        self._here, self._at = ctypes.addressof(self._struct), address(self.position)
        self._core = core.calls()

    def to_velocity(self, wanted: Array, q: Array) -> None:
        """Approach the wanted velocities from q; before a position limit no more than can still be braked."""
        self._core.to_velocity(self._here, numbers(wanted, self._count), numbers(q, self._count))

    def to_position(self, wanted: Array) -> None:
        """Advance the positions on the way to the wanted ones, to arrive there at rest."""
        self._core.to_position(self._here, numbers(wanted, self._count), self._at)

    def runs_out(self, q: Array, moving: Array) -> bool:
        """Whether some motor that moves so, rad/s, is a tick of braking too fast to stop before its position limit."""
        return bool(self._core.runs_out(self._here, numbers(q, self._count), numbers(moving, self._count)))
