# SPDX-License-Identifier: Apache-2.0
"""Moves the attractors of several parts (the postures to which the controller moves them) together along a path, by the robot's clock."""

from __future__ import annotations

import time
import uuid
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress

import numpy as np

from bus_schema.messages import Tick
from bus_schema.rpc import Goal
from mobee.arrays import Array
from mobee.control.gains import Settle
from mobee.errors import ActionInterrupted, MobeeError
from mobee.plant import Outcome
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Robot
from services.common.bus_plant import BusPlant, Sent
from services.common.rpc import CallFailed
from services.common.service import Service

TAKE_TIMEOUT = 8.0  # s until the parts are under control and their goals free
CLOCK_TIMEOUT = 5.0  # s within which the robot's clock must advance
WINDOW, DRIFT = 0.3, 1e-3  # s; rad by which the mean of the encoders may change from one window to the next in a part at rest
REST_TIMEOUT = 60.0  # s until the parts rest after the motion; the controller ends an action before


class BusFollower(BusPlant):
    """A `BusPlant` (the live robot as a plant) that moves several parts together along a path of attractors. All waits have time limits.

    An attractor is the posture to which the controller moves a part.
    """

    def __init__(self, service: Service, robot: Robot) -> None:
        super().__init__(service, robot, tuple(robot.parts))
        self._seen: deque[tuple[float, Array]] = deque()  # s of the robot's clock, encoders (n,); of the last two windows
        self._followed: list[tuple[float, Array]] = []  # the same since `follow` began
        self._is_following = False
        service.on_newest(Tick, self._note_tick)

    @property
    def q(self) -> Array:
        """The newest encoder values of all motors, (n,) rad; raises MobeeError if no tick of the robot arrives."""
        self._service.spin(time.monotonic() + TAKE_TIMEOUT, lambda: bool(self._seen))
        if not self._seen:
            raise MobeeError("no tick of the robot was received: `mobee status` shows whether robot_sim runs")
        return self._seen[-1][1]

    def come_to_rest(self, parts: Sequence[str], settle: Settle) -> None:
        """Wait until the parts `parts` rest; raises MobeeError if one still moves after TAKE_TIMEOUT (8 s).

        A part rests if its commanded speed and acceleration are at most those of `settle`, and the mean of its encoder values changes by
        less than DRIFT (0.001 rad) from one window of WINDOW (0.3 s) to the next. The commanded speed alone is not enough: a part that is
        slower than the threshold of `Gains.published_2014` (1 deg/s) can still be half a degree from its goal. Therefore the encoders are
        tested too.
        """

        def moving() -> list[str]:
            return [part for part in parts if not self._is_commanded_to_rest(part, settle) or self._drifts(part)]

        self._service.spin(time.monotonic() + TAKE_TIMEOUT, lambda: not moving())
        if moving():
            raise MobeeError(f"{', '.join(moving())}: still moving after {TAKE_TIMEOUT:g} s; `mobee status` shows which process moves it")

    def take(self, parts: Sequence[str]) -> None:
        """Take the ownership of the goals of `parts` (the right to set their attractors), and wait until these parts are under control.

        A part is under control when robot_sim follows the controller's commands to it. Raises MobeeError if a part is still in hold (it
        stands still and follows no commands) after TAKE_TIMEOUT (8 s), or if its goal belongs to another service.
        """
        give_up = time.monotonic() + TAKE_TIMEOUT
        while not self._has(parts):
            if time.monotonic() > give_up:
                waiting = ", ".join(part for part in parts if not self._has([part]))
                raise MobeeError(f"{waiting} in hold: `mobee status` shows why, `mobee estop --reset` ends an emergency stop")
            for part in parts:
                self._take(part)
            self._wait(lambda: self._has(parts))

    def follow(
        self, parts: Sequence[str], attractors: Sequence[Array], period: float, progress: Callable[[float], None] = lambda share: None
    ) -> dict[str, Outcome]:
        """Move the attractors of taken parts along `attractors`, and wait until all these parts rest; return the outcomes by part.

        The attractor of a part is the posture to which the controller moves it.

        Args:
            parts: names of parts whose goals were taken with `take`.
            attractors: rows of motor positions (n,) rad of the whole robot, one for each period.
            period: time from one row to the next, s of the robot's clock. If the process is late, rows are skipped, but never the last one.
            progress: called with the share of the rows, 0 to 1, that have been set.

        Raises ActionInterrupted if a part is in hold (it stands still and follows no commands) or was taken by another service, if the
        controller ends, if robot_sim starts a new run, if the robot's clock stands still, or if a part does not rest within 60 s
        (REST_TIMEOUT) after the last row. Call `let_go` afterwards.
        """
        begun, run, last = self._now, self._runs, len(attractors) - 1
        self._followed.clear()
        self._is_following = True
        asked: dict[str, Sent] = {}
        row, before = 0, None
        while True:
            here = attractors[row]
            for part in parts:
                where = self.robot.part(part).slice
                if before is None or row == last or not np.array_equal(here[where], before[where]):
                    asked[part] = self._aim(part, here[where])
            progress(row / max(1, last))
            if row == last:
                break
            self._until(parts, run, self._reached(begun + (row + 1) * period), CLOCK_TIMEOUT, "the robot's clock stands still")
            row, before = min(max(row + 1, int((self._now - begun) / period)), last), here
        self._until(
            parts, run, lambda: all(self._is_over(part, one) for part, one in asked.items()), REST_TIMEOUT, "it does not come to rest"
        )
        return {part: self._outcome(part, one) for part, one in asked.items()}

    def seen(self) -> tuple[Array, Array]:
        """Return the times (T,) s of all ticks since `follow` began, from the first of them on, and the encoder values (T, n) rad.

        The ticks after `let_go` are not among them.
        """
        times = np.array([time_ for time_, _ in self._followed])
        return times - times[:1], np.array([q for _, q in self._followed])

    def let_go(self) -> None:
        """Release the goals of all taken parts (the right to set their attractors); the parts then stay where they are.

        A goal that this service no longer owns is ignored.
        """
        self._is_following = False
        for part in list(self._epochs):
            with suppress(CallFailed):  # lost already, or there is no controller: then the part holds
                self.release(part)

    @property
    def _now(self) -> float:
        return float(self._service.bus.t) * 1e-9

    def _reached(self, moment: float) -> Callable[[], bool]:
        return lambda: self._now >= moment

    def _has(self, parts: Sequence[str]) -> bool:
        return all(self._owns(part) and self._is_free(part) for part in parts)

    def _aim(self, part: str, target: Array) -> Sent:
        """Set a part's attractor (n_part,) rad."""
        return self._send(part, "goal", Goal, uuid.uuid4().hex, q=[float(x) for x in target])

    def _until(self, parts: Sequence[str], run: int, enough: Callable[[], bool], patience: float, why: str) -> None:
        """Wait until `enough` returns True; raises ActionInterrupted with `why` after `patience` s, or if a part is lost."""
        give_up = time.monotonic() + patience
        while not enough():
            if run != self._runs:
                raise ActionInterrupted("robot_sim started a new run")
            if not self._service.alive.get("controller"):
                raise ActionInterrupted("the controller is gone")
            if not self._has(parts):
                lost = ", ".join(part for part in parts if not self._has([part]))
                raise ActionInterrupted(f"{lost}: in hold, or taken by another service")
            if time.monotonic() > give_up:
                raise ActionInterrupted(why)
            self._service.check_router()
            self._wait(lambda: enough() or not self._has(parts))

    def _note_tick(self, tick: Tick) -> None:
        now = tick.t * 1e-9
        while self._seen and not now - 2.0 * WINDOW < self._seen[0][0] <= now:  # too old, or of the run before
            self._seen.popleft()
        self._seen.append((now, np.array(tick.q)))
        if self._is_following:
            self._followed.append(self._seen[-1])

    def _is_commanded_to_rest(self, part: str, settle: Settle) -> bool:
        motion = self._motion.get(part)
        if motion is None:
            return False
        unit = fine_units(self.robot)[self.robot.part(part).slice]
        slow, calm = np.abs(motion.dq) <= settle.speed * unit, np.abs(motion.ddq) <= settle.acceleration * unit
        return bool((slow & calm).all())

    def _drifts(self, part: str) -> bool:
        where, now = self.robot.part(part).slice, self._now
        seen = [(t, q[where]) for t, q in self._seen if t > now - 2.0 * WINDOW]
        before, after = ([q for t, q in seen if (t > now - WINDOW) is late] for late in (False, True))
        if not before or not after or now - seen[0][0] < 1.5 * WINDOW:
            return True  # not seen for long enough
        change = np.mean(after, axis=0) - np.mean(before, axis=0)
        return bool((np.abs(change) > DRIFT * fine_units(self.robot)[where]).any())
