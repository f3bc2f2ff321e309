"""Which motors babble, and where to."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array, Robot

ROBOT = "icub"
HANDS = ("hand", "thumb", "index", "middle", "pinky")  # in the names of the motors that are left alone
COUNT = 23  # thesis 4.1.1: "all joints on the iCub upper-body except those in the hands"


def moved_motors(robot: Robot) -> Array:
    """Indices of the 23 motors: torso 3, head with eyes 6, and 7 of each arm."""
    return np.array([i for i, name in enumerate(robot.motors) if not any(word in name for word in HANDS)])


class Targets:
    """Random postures, the same sequence for the same seed: uniform in the whole ranges of the 23 motors; hands stay at home."""

    def __init__(self, robot: Robot, seed: int) -> None:
        self._rng = np.random.default_rng([seed, 0xBABB1E])
        self._moved = moved_motors(robot)
        self._home, self._limits = robot.home, robot.limits[self._moved]

    def next(self) -> Array:
        """A posture of the whole robot, (n,) rad."""
        q = self._home.copy()
        q[self._moved] = self._rng.uniform(self._limits[:, 0], self._limits[:, 1])
        return q
