"""Position moves as motor boards make them: every motor for itself, with least jerk, within its speed."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array

PEAK = 1.875  # peak over mean speed of a minimum-jerk motion


class PositionMove:
    """From rest to rest; arrays (n,) rad."""

    def __init__(self, start: Array, target: Array, speed: Array) -> None:
        """`speed` (n,) rad/s: the peak that no motor exceeds."""
        self._start, self._way = start, target - start
        self._durations = PEAK * np.abs(self._way) / speed
        self.duration = float(self._durations.max())  # s

    def at(self, t: float) -> Array:
        """Where the motors shall be t [s] after the start."""
        share = np.divide(t, self._durations, out=np.ones_like(self._durations), where=self._durations > 0.0).clip(0.0, 1.0)
        smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        position: Array = self._start + smooth * self._way
        return position
