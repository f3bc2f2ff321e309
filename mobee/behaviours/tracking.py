# SPDX-License-Identifier: Apache-2.0
"""Tracking of a moving target: the estimate of its present position, and a speed-limited trajectory that catches up with a goal.

The position is estimated from the last seen places, because pictures are late and rare. The trajectory stays within the limits of speed and
acceleration of the motors.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from mobee.arrays import Array, real_array
from mobee.errors import InvalidValue
from mobee.robot.motor_units import motor_units
from mobee.robot.robot import Robot

WINDOW = 0.5  # s: places within this time of the newest are used
LEAST_SPAN = 0.12  # s between the first and the last of them, from which a velocity can be computed
JUMP = 0.05  # m from where the target was expected: it has jumped, and older places are of another motion

SPEED, ACCELERATION = 0.95, 0.8  # shares of the motors' limits; the rest is for the control law
CLOSE = 15.0  # 1/s: rate at which a small distance decreases
BRAKING = 1.5  # 2 is the least distance in which a reference can brake; the rest is for a goal that accelerates
LEASH = np.deg2rad(15.0)  # rad by which the reference may be ahead of its motor, which something may block


class TargetTrack:
    """Estimates the motion of a target that moves at a constant velocity, or jumps.

    All times [s] are those of one clock; the zero of this clock is arbitrary. All positions are in one fixed frame, such as the root frame.
    """

    def __init__(self, patience: float = 0.6) -> None:
        """Make a track; `patience`: time after the last seen place for which the motion is extrapolated [s]."""
        if not 0.0 < patience < np.inf:
            raise InvalidValue(f"patience {patience!r} s: must be a finite time above 0")
        self.patience = patience
        self._seen: deque[tuple[float, Array]] = deque()

    def note(self, t: float, place: Array) -> None:
        """Add a place (3,) m at which the target was seen at time t [s]; a place that is not newer than the last one is ignored.

        Raises InvalidValue if a number is not finite or the shape is wrong.
        """
        place = real_array("place", place)
        if place.shape != (3,) or not (np.isfinite(place).all() and np.isfinite(t)):
            raise InvalidValue(f"place {place.tolist()} of the target at {t} s: must be three finite numbers, in m, at a finite time")
        if self._seen and t <= self._seen[-1][0]:
            return
        if self._seen and np.linalg.norm(place - self._on_line(t)[0]) > JUMP:
            self._seen.clear()
        self._seen.append((t, place))
        while t - self._seen[0][0] > WINDOW:
            self._seen.popleft()

    def at(self, t: float) -> tuple[Array, Array] | None:
        """Return the position (3,) m and velocity (3,) m/s of the target at time t [s], by a line fitted to the last seen places.

        If these cover less than 0.12 s, the position is the last place, and the velocity is 0. Returns None if no place is known, or if the
        last one was seen more than `patience` (0.6 s by default) before t.
        """
        if not self._seen or t - self._seen[-1][0] > self.patience:
            return None
        return self._on_line(t)

    def _on_line(self, t: float) -> tuple[Array, Array]:
        """Return what `at` returns, however long ago the last place was seen."""
        times = np.array([time for time, _ in self._seen])
        places = np.array([place for _, place in self._seen])
        if times[-1] - times[0] < LEAST_SPAN:
            return places[-1].copy(), np.zeros(3)
        off = times - times.mean()
        velocity = off @ (places - places.mean(axis=0)) / (off @ off)
        return places.mean(axis=0) + (t - times.mean()) * velocity, velocity

    def forget(self) -> None:
        """Remove all places; call this when the robot is restarted, since its clock then begins again."""
        self._seen.clear()


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
        self._leash = LEASH * motor_units(robot)[where]
        self._low, self._high = np.minimum(low, q), np.maximum(high, q)
        self.q, self.velocity = q.copy(), np.zeros(len(q))

    def catch_up(self, goal: Array, goal_velocity: Array, near: Array, dt: float) -> None:
        """Advance the reference by dt [s] towards a moving goal.

        Far from the goal it moves at full speed. It brakes early enough to arrive with the velocity of the goal within the acceleration
        limit.

        Args:
            goal: (m,) rad, the present goal.
            goal_velocity: (m,) rad/s.
            near: (m,) rad, the expected positions of the motors; the reference stays within 15 degrees of them (for a motor that
                slides, a length: `mobee.robot.motor_units.motor_units`).
            dt: s.
        """
        left = goal - self.q
        rate = np.minimum(CLOSE * np.abs(left), np.sqrt(BRAKING * self._hardest * np.abs(left)))
        wanted = np.clip(goal_velocity + np.sign(left) * rate, -self._fastest, self._fastest)
        change = self._hardest * dt
        before = self.q
        self.velocity = self.velocity + np.clip(wanted - self.velocity, -change, change)
        self.q = np.clip(np.clip(before + self.velocity * dt, near - self._leash, near + self._leash), self._low, self._high)
        self.velocity = np.where((self.q <= self._low) | (self.q >= self._high), (self.q - before) / dt, self.velocity)
