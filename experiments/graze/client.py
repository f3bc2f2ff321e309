"""A client that insists: it commands its way at a share of full speed, and once more from the beginning when it failed."""

from __future__ import annotations

import numpy as np

from experiments.graze.approach import Way
from mobee.robot.robot import Array, Robot

SPEED = 0.2  # of the motors' top speed, as in the thesis


class Client:
    """Position references along a way, tick by tick."""

    def __init__(self, robot: Robot, way: Way, dt: float) -> None:
        fastest = SPEED * np.array([motor.max_velocity for motor in robot.motor_table])
        steps = np.abs(np.diff(way.postures, axis=0)) / fastest  # s, the slowest motor of each step sets the pace
        times = np.concatenate([[0.0], np.cumsum(steps.max(axis=1))])
        self._ticks = np.arange(0.0, times[-1], dt)
        self._references = np.array([np.interp(self._ticks, times, column) for column in way.postures.T]).T
        self.begin = int(np.searchsorted(self._ticks, times[way.start]))  # index of the reference at the start
        self._next = 0
        self.runs = 0  # how often it has left the start

    @property
    def start(self) -> Array:
        """Where the robot stands before it begins: above the start."""
        return self._references[0]

    @property
    def leaves_start(self) -> bool:
        """Whether the next reference begins the way into the field: a position command of its own."""
        return self._next == self.begin

    @property
    def is_over(self) -> bool:
        """Whether the end has been commanded."""
        return self._next >= len(self._references)

    def next(self) -> Array:
        """The next reference (n,) rad; the last one for ever."""
        self.runs += self.leaves_start
        reference: Array = self._references[min(self._next, len(self._references) - 1)]
        self._next += 1
        return reference

    def retry(self, q: Array) -> None:
        """Go on from whichever is nearer to q (n,) rad: the beginning above the start, or the start."""
        places = (0, self.begin)
        self._next = min(places, key=lambda place: float(np.abs(self._references[place] - q).max()))
