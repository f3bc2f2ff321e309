# SPDX-License-Identifier: Apache-2.0
"""Notices by the torques of the motors that a limb has bumped into something that the model does not know (thesis 4.3.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mobee.arrays import Array
from mobee.model.masses import gravity_torque
from mobee.robot.robot import Robot

THRESHOLD = 0.55  # N m, norm over the watched motors, of the change of what gravity does not explain
TICKS = 4  # in a row: single ones come from the play of the motors
SLOW = 0.5  # s, time constant of the mean from which the change is measured
START = 1.2  # s after the start of a motion, in which the limb is accelerated and the play is taken up


class BumpWatch:
    """Watches motors near the body, which the fingers' joints and the play of the wrist disturb least.

    What gravity does not explain changes slowly in a free motion, and at once in a bump.
    """

    def __init__(self, robot: Robot, motors: Sequence[str], threshold: float = THRESHOLD) -> None:
        """`motors`: those that are watched, such as the shoulder's.  `threshold`: N m."""
        self._robot, self._threshold = robot, threshold
        self._columns = np.array([robot.motor_index(name) for name in motors])
        self.begin()

    def begin(self) -> None:
        """Begin to watch a new motion."""
        self._mean: Array | None = None
        self._time, self._above = 0.0, 0

    def note(self, q: Array, torques: Array, dt: float) -> bool:
        """Return whether the limb bumps into something, from positions (n,) rad and torques (n,) N m read dt s after the last ones."""
        unexplained = (torques - gravity_torque(self._robot, q))[self._columns]
        self._time += dt
        if self._mean is None or self._time < START:
            self._mean = unexplained
            return False
        change = float(np.linalg.norm(unexplained - self._mean))
        self._above = self._above + 1 if change > self._threshold else 0
        if self._above == 0:
            self._mean = self._mean + min(1.0, dt / SLOW) * (unexplained - self._mean)
        return self._above >= TICKS
