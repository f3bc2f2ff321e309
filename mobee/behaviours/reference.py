# SPDX-License-Identifier: Apache-2.0
"""A reference trajectory that catches up with a moving goal, within the limits of speed and acceleration of the motors."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.robot.robot import Robot

SPEED, ACCELERATION = 0.95, 0.8  # shares of the motors' limits; the rest is for the control law
CLOSE = 15.0  # 1/s: rate at which a small distance decreases
BRAKING = 1.5  # 2 is the least distance in which a reference can brake; the rest is for a goal that accelerates
LEASH = np.deg2rad(15.0)  # rad by which the reference may be ahead of its motor, which something may block


class Reference:
    """The reference trajectory of m motors, which moves towards a moving goal within the limits of speed and acceleration.

    `q`, `velocity`: (m,) rad and (m,) rad/s, present position and velocity on the trajectory.
    """

    def __init__(self, robot: Robot, where: slice, q: Array, low: Array, high: Array, speed: float = SPEED) -> None:
        """Start at rest at q (m,) rad.

        `where`: range of the indices of the m motors. `low`, `high`: (m,) rad, limits of the reference. `speed`: share of the motors'
        largest speed that is used.
        """
        table = robot.motor_table[where]
        self._fastest = speed * np.array([motor.max_velocity for motor in table])
        self._hardest = ACCELERATION * np.array([motor.max_acceleration for motor in table])
        self._low, self._high = np.minimum(low, q), np.maximum(high, q)
        self.q, self.velocity = q.copy(), np.zeros(len(q))

    def catch_up(self, goal: Array, goal_velocity: Array, near: Array, dt: float) -> None:
        """Advance the reference by dt [s] towards a moving goal.

        Far from the goal it moves at full speed. It brakes early enough to arrive with the velocity of the goal within the acceleration
        limit.

        Args:
            goal: (m,) rad, the present goal.
            goal_velocity: (m,) rad/s.
            near: (m,) rad, the expected positions of the motors; the reference stays within 15 degrees of them.
            dt: s.
        """
        left = goal - self.q
        rate = np.minimum(CLOSE * np.abs(left), np.sqrt(BRAKING * self._hardest * np.abs(left)))
        wanted = np.clip(goal_velocity + np.sign(left) * rate, -self._fastest, self._fastest)
        change = self._hardest * dt
        before = self.q
        self.velocity = self.velocity + np.clip(wanted - self.velocity, -change, change)
        self.q = np.clip(np.clip(before + self.velocity * dt, near - LEASH, near + LEASH), self._low, self._high)
        self.velocity = np.where((self.q <= self._low) | (self.q >= self._high), (self.q - before) / dt, self.velocity)
