# SPDX-License-Identifier: Apache-2.0
"""Detects by the torques of the motors that a limb has bumped into something that the model does not know (thesis 4.3.3)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mobee.arrays import Array, is_number
from mobee.control.forces import checked
from mobee.errors import InvalidValue
from mobee.model.masses import gravity_torque
from mobee.robot.robot import Robot

THRESHOLD = 0.55  # N m, norm over the watched motors, of the change of what gravity does not explain
TICKS = 4  # in a row: single ones come from the play of the motors
SLOW = 0.5  # s, time constant of the mean from which the change is measured
START = 1.2  # s after the start of a motion, in which the limb is accelerated and the play is taken up


class BumpWatch:
    """Detects that a limb has bumped into something, by the torques of the limb's motors near the trunk, such as those of the shoulder.

    The motion of the fingers and the play of the wrist disturb these motors least. The part of the torque that gravity does not explain
    changes slowly in a free motion, and suddenly in a bump.
    """

    def __init__(self, robot: Robot, motors: Sequence[str], threshold: float = THRESHOLD) -> None:
        """Watch the named motors, such as those of the shoulder; `threshold`: change of the torques that counts as a bump [N m].

        The change is the Euclidean norm over the watched motors. Raises UnknownName for an unknown motor, and InvalidValue without a motor
        or for a threshold that is not above 0.
        """
        if not len(motors):
            raise InvalidValue("motors: none is named; name those whose torques show a bump, such as the shoulder's")
        if not (is_number(threshold) and 0.0 < threshold < np.inf):
            raise InvalidValue(f"threshold {threshold!r} N m: must be a finite torque above 0")
        self._robot, self._threshold = robot, threshold
        self._columns = np.array([robot.motor_index(name) for name in motors])
        self.begin()

    def begin(self) -> None:
        """Begin to watch a new motion; call it at the start of each motion."""
        self._mean: Array | None = None
        self._time, self._above = 0.0, 0

    def note(self, q: Array, torques: Array, dt: float) -> bool:
        """Take the next measurement and return whether the limb has bumped into something.

        It has if the torques that gravity does not explain have changed by more than the threshold in four measurements in a row. `q`: (n,)
        rad, positions. `torques`: (n,) N m. `dt`: time since the last call [s]. In the first 1.2 s of a motion no bump is detected. Raises
        InvalidValue for a wrong shape, and for numbers that are not finite.
        """
        count = len(self._robot.motors)
        q, torques = checked("q", q, count), checked("torques", torques, count)
        if not np.isfinite(dt):
            raise InvalidValue(f"dt {dt} s: must be a finite time")
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
