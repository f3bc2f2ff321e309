# SPDX-License-Identifier: Apache-2.0
"""The running robot as a `mobee.behaviours.pick.Body`, the interface by which the fetching of a cup moves a robot along paths."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from bus_schema.messages import State
from mobee.arrays import Array
from mobee.behaviours.bump import BumpWatch
from mobee.behaviours.pick import BACK, CALM, Followed, Forces
from mobee.control.gains import Gains
from mobee.errors import ActionInterrupted
from mobee.roadmap.playback import PERIOD, attractors, timed
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Robot
from services.common.bus_follow import BusFollower
from services.common.service import Service

SLOW = float(np.deg2rad(1.0))  # rad/s, of motors at rest
HOLDS = 10  # in a row, after each of which the motion continues
SLOWEST = 0.1  # simulated s in a s of real time
STILL = 0.3  # s of the robot's clock in which nothing may be commanded to move


class Bumped(Exception):
    """Raised to end a motion in which the arm has bumped into something."""


class BusBody(BusFollower):
    """The running robot as a `mobee.behaviours.pick.Body`: moves the parts `parts` along paths, by their attractors.

    The attractor of a part is the posture to which the springs of the control law pull it. `gains`: the gains of the running controller's
    law. `require_seen`: called before attractors are set, and after each wait; it raises an error to end the motion, for example if the cup
    was not seen for too long.
    """

    def __init__(self, service: Service, robot: Robot, parts: Sequence[str], gains: Gains, require_seen: Callable[[], None]) -> None:
        super().__init__(service, robot)
        self._parts, self._gains, self._require_seen = tuple(parts), gains, require_seen
        self._torques = np.zeros(len(robot.motors))
        self._watch: BumpWatch | None = None
        self._last, self._bumped = 0.0, False
        self._goal = robot.home
        for part in robot.parts:
            service.on_each(State, partial(self._note_state, part), part)

    def follow_path(self, path: Array, speed: float, watch: BumpWatch | None = None, forces: Forces | None = None) -> Followed:
        """Move the parts of this body along a path of whole postures, (K, n) rad; then wait until they rest, for at most 1.5 s (CALM).

        Returns whether the arm has bumped into something, and the posture (n,) rad at the bump, or, without a bump, at the end of the
        motion. After a bump the robot moves back to the posture that it had 3 s (BACK) before the bump. Raises MobeeError if the motion
        cannot be continued, for example because another service has taken a part, or the robot's clock stands still.

        `speed`: share of the motors' largest speed, above 0 and at most 1. `watch`: detects bumps; None: they are not detected. `forces`:
        function that takes a posture (n,) rad and returns the forces (n,) rad/s^2 of the control law except spring and damping. The
        attractors are shifted such that their springs cancel these forces; None: they are not cancelled.
        """
        robot = self.robot
        rows = list(attractors(robot, timed(robot, np.clip(path, *robot.limits.T), self._gains, speed), self._gains, forces))
        if watch is not None:
            watch.begin()
        self._watch, self._bumped, self._last = watch, False, self._now
        passed: list[Array] = []
        begun = self._now
        try:
            for number, row in enumerate(rows):
                self._step(row)
                passed.append(self.q)
                self._wait_until(begun + (number + 1) * PERIOD)
        except Bumped:
            self._watch, found = None, Followed(True, self.q)
            self.rest_at(passed[-min(len(passed), round(BACK / PERIOD))] if passed else self.q)
            return found
        finally:
            self._watch = None
        self._calm()
        return Followed(False, self.q)

    def press(self, q: Array, seconds: float) -> None:
        """Set the attractors of this body's parts to the posture q (n,) rad at once, without a path, and wait for `seconds`.

        The attractor of a part is the posture to which the control law pulls it. The time is that of the robot's clock.
        """
        self._step(q)
        self._wait_until(self._now + seconds)

    def rest_at(self, q: Array) -> None:
        """Set the attractors of this body's parts to the posture q (n,) rad, and wait until the commanded speeds are almost 0.

        The attractor of a part is the posture to which the control law pulls it. The wait takes at most 1.5 s (CALM) of the robot's clock.
        """
        self._step(q)
        self._calm()

    def _step(self, q: Array) -> None:
        """Set the attractors of the parts to those of q (n,) rad.

        After a hold, in which parts stand still and follow no commands, this is done as soon as they are under control again.
        """
        self._require_seen()
        self._goal = np.clip(q, *self.robot.limits.T)
        for left in reversed(range(HOLDS)):
            try:
                for part in self._parts:
                    self._aim(part, self._goal[self.robot.part(part).slice])
                return
            except ActionInterrupted:
                if not left:
                    raise
                self.take(self._parts)

    def _calm(self) -> None:
        """Wait until nothing that carries the hand is commanded to move, or for CALM s of the robot's clock."""
        end, still = self._now + CALM, self._now
        slow = SLOW * fine_units(self.robot)
        while self._now < end and self._now - still < STILL:
            self._wait_until(self._now + PERIOD)
            fast = any(
                (np.abs(self._motion[part].dq) > slow[self.robot.part(part).slice]).any() for part in self._parts if part in self._motion
            )
            still = self._now if fast else still

    def _wait_until(self, moment: float) -> None:
        """Wait for a moment of the robot's clock, s; raises Bumped, and ActionInterrupted if a part is lost or the clock stands still."""
        run, patience = self._runs, (moment - self._now) / SLOWEST + 5.0
        while self._now < moment and not self._bumped:
            try:
                self._until(self._parts, run, lambda: self._now >= moment or self._bumped, patience, "the robot's clock stands still")
            except ActionInterrupted:
                if run != self._runs or self._has(self._parts):
                    raise
                self._step(self._goal)
        self._require_seen()
        if self._bumped:
            self._bumped = False
            raise Bumped

    def _note_state(self, part: str, state: State) -> None:
        self._torques[self.robot.part(part).slice] = state.tau
        if self._watch is None or part != self._parts[-1] or not self._seen:
            return
        now = state.t * 1e-9
        if self._watch.note(self._seen[-1][1], self._torques, now - self._last):
            self._bumped = True
        self._last = now
