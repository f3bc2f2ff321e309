# SPDX-License-Identifier: Apache-2.0
"""Takes the drives of all parts (the rights to command their motors) at robot_sim, and arms them, so that the motors follow the commands.

If robot_sim has held a part (stopped it, so that it follows no commands), its drive is taken and armed again.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from bus_schema import keys
from bus_schema.messages import EStop, PartStatus
from bus_schema.rpc import Driven, Take, Taken, WithEpoch
from mobee.robot.robot import Robot
from services.common.emergency_stop import StopLine
from services.common.rpc import CallFailed
from services.common.service import Service

RETRY_PERIOD = 0.2  # s between attempts to arm a part
STOP_PERIOD = 0.1  # s between two repetitions of an emergency stop that robot_sim has not latched
CONFIRM_TIME = 0.1  # s within which the state of a part must show that it was armed


class Drives:
    """Takes and arms the drives of all parts, and knows whether robot_sim follows this controller's commands to them.

    A drive is the right to command the motors of one part, which follow the commands when the drive is armed. `epochs`: for each part, the
    number of this controller's ownership of the drive, which each command must contain; 0: the drive is not armed. No method waits for an
    answer, because the other parts need their commands while one is being armed. In lockstep (every tick waits for all participants), the
    times between attempts to arm are measured on the bus clock, otherwise on the monotonic clock.
    """

    def __init__(self, service: Service, robot: Robot) -> None:
        self._service, self._patience = service, service.patience
        self.epochs: dict[str, int] = dict.fromkeys(robot.parts, 0)
        self._next_try = dict.fromkeys(robot.parts, 0.0)
        self._confirm_by = dict.fromkeys(robot.parts, 0.0)
        self._stop: EStop | None = None  # an emergency stop outlives a robot_sim that dies
        self._stop_is_latched = False  # robot_sim has shown in this run that it obeys the stop
        self._repeat_at = 0.0  # monotonic clock
        self._stops, self._line = service.bus.publisher(EStop), StopLine(service.bus.session)
        self._attempts: dict[str, object] = {}  # part -> identity of the attempt in progress
        self._on_attempt_end: list[Callable[[], None]] = []

    def on_attempt_end(self, handler: Callable[[], None]) -> None:
        """Call `handler` when an attempt to arm a part has succeeded or failed."""
        self._on_attempt_end.append(handler)

    @property
    def is_arming(self) -> bool:
        """Whether an attempt to arm a part is in progress."""
        return bool(self._attempts)

    def _now(self) -> float:
        return self._service.bus.t * 1e-9 if self._service.locked else time.monotonic()

    def is_armed(self, part: str, state: PartStatus) -> bool:
        """Return whether the part follows this controller's commands.

        This is so if its newest state shows it, or if robot_sim has armed it in the last 0.1 s: the state may not show that yet.
        """
        if self.epochs[part] == 0:
            return False
        if state.epoch == self.epochs[part] and state.gate == "armed":
            self._confirm_by[part] = 0.0
            return True
        return self._now() < self._confirm_by[part]

    def forget(self) -> None:
        """Set all drives to "not armed" (`epochs` 0), and ignore the answers to `take` and `arm` calls that are in progress.

        Call this at the start of a new run of robot_sim.
        """
        self.epochs = dict.fromkeys(self.epochs, 0)
        self._next_try = dict.fromkeys(self._next_try, 0.0)
        self._attempts.clear()
        self._stop_is_latched = False

    def watch_stop(self, parts: Mapping[str, PartStatus]) -> bool:
        """Read emergency stops from the bus, and return whether one is in force or has arrived since the last call.

        After a stop no part is armed until the safety gates show that the stop was reset. This method publishes the stop again every 0.1 s
        until robot_sim obeys it. It discards the stop when robot_sim has obeyed it and no gate is in the state "estop" any more. `parts`:
        the newest status of each part, which shows nothing of a stop that began and was reset in a pause or while this process was frozen.
        """
        now, arrived = time.monotonic(), self._line.take()
        for message in arrived:
            if self._stop is None:  # it is left to robot_sim first: a repetition could come after its release
                self._repeat_at = now + STOP_PERIOD
            self._stop = message
            self._stop_is_latched |= message.src == "robot_sim" and message.run == self._service.bus.run
        if self._stop is None:
            return False
        if any(state.gate == "estop" for state in parts.values()):
            self._stop_is_latched = True
        elif self._stop_is_latched:
            self._stop, self._stop_is_latched = None, False
        elif now >= self._repeat_at:
            self._repeat_at = now + STOP_PERIOD
            self._stops.put(set=True, source=self._stop.source, reason=self._stop.reason)
        return bool(arrived) or self._stop is not None

    def can_arm(self, state: PartStatus) -> bool:
        """Return whether this controller may now take and arm the drive of a part, the right to command the part's motors.

        This is so if there is no emergency stop, and the part's safety gate in robot_sim is "idle", "hold" or "armed". `state`: status of
        the part, with the state of its gate. In "hold" the part stands still, in "armed" it follows the commands of the drive's owner.
        """
        return self._stop is None and state.gate in ("idle", "hold", "armed")

    def try_arm(self, part: str, state: PartStatus) -> None:
        """Begin to take and arm the drive of a part; `is_armed` returns True when it is armed.

        Nothing happens if the part cannot be armed (`can_arm`), if an attempt is in progress, or within 0.2 s of the last one.
        """
        now = self._now()
        if not self.can_arm(state) or now < self._next_try[part] or part in self._attempts:
            return
        if not self._service.locked or self._service.bus.k > 0:  # in tick 0, which is repeated, time stands still
            self._next_try[part] = now + RETRY_PERIOD
        self.epochs[part] = 0
        attempt = self._attempts[part] = object()
        self._service.ask(
            keys.drive(part, "take"),
            Taken,
            lambda answer: self._taken(part, attempt, answer),
            request=Take,
            timeout=self._patience,
            instance=self._service.instance,
        )

    def _taken(self, part: str, attempt: object, answer: Taken | CallFailed) -> None:
        if self._attempts.get(part) is not attempt:
            return
        if isinstance(answer, CallFailed):
            self._failed(part, str(answer))
            return
        epoch = answer.epoch
        self._service.ask(
            keys.drive(part, "arm"),
            Driven,
            lambda driven: self._driven(part, attempt, epoch, driven),
            request=WithEpoch,
            timeout=self._patience,
            epoch=epoch,
        )

    def _driven(self, part: str, attempt: object, epoch: int, answer: Driven | CallFailed) -> None:
        if self._attempts.get(part) is not attempt:
            return
        if isinstance(answer, CallFailed) or answer.gate != "armed":
            self._failed(part, str(answer) if isinstance(answer, CallFailed) else f"gate {answer.gate}")
            return
        del self._attempts[part]
        self.epochs[part] = epoch
        self._confirm_by[part] = self._now() + CONFIRM_TIME
        self._service.bus.event("info", "armed", f"{part} is under control, epoch {epoch}")
        self._end_attempt()

    def _failed(self, part: str, why: str) -> None:
        del self._attempts[part]
        self._service.log.info("%s cannot be armed yet: %s", part, why)
        self._end_attempt()

    def _end_attempt(self) -> None:
        for handler in self._on_attempt_end:
            handler()
