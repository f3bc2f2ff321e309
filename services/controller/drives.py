"""Ownership of the motors: every part is taken and armed by the controller, and again after each hold."""

from __future__ import annotations

import time

from bus_schema import keys
from bus_schema.messages import EStop, State
from bus_schema.rpc import Driven, Take, Taken, WithEpoch
from mobee.robot.robot import Robot
from services.common.rpc import CallFailed
from services.common.service import Service

RETRY = 0.2  # s between attempts to arm a part
SHOWS = 0.1  # s after which the state of a part must show that it was armed


class Drives:
    """The drive epoch of each part, and whether robot_sim obeys it.

    Never waits for an answer: while one part is armed the others need their commands.
    """

    def __init__(self, service: Service, robot: Robot) -> None:
        self._service = service
        self.epochs: dict[str, int] = dict.fromkeys(robot.parts, 0)
        self._next_try = dict.fromkeys(robot.parts, 0.0)
        self._shows_by = dict.fromkeys(robot.parts, 0.0)
        self._stopped = False  # an emergency stop outlives a robot_sim that dies under it
        self._asking: dict[str, object] = {}  # part -> mark of the attempt under way

    def armed(self, part: str, state: State) -> bool:
        """Whether the part does what this controller commands, as of its newest state; or will have, if it was armed just now."""
        if self.epochs[part] == 0:
            return False
        if state.epoch == self.epochs[part] and state.gate == "armed":
            self._shows_by[part] = 0.0
            return True
        return time.monotonic() < self._shows_by[part]

    def forget(self) -> None:
        """A new run of robot_sim: all epochs are void, and answers still to come are too."""
        self.epochs = dict.fromkeys(self.epochs, 0)
        self._next_try = dict.fromkeys(self._next_try, 0.0)
        self._asking.clear()

    def note_stop(self, message: EStop) -> None:
        """An emergency stop, or its reset: between them nothing is armed."""
        self._stopped = message.set

    def try_arm(self, part: str, state: State) -> None:
        """Begin to take and arm a part that is idle or in hold; `armed` says when it is done."""
        now = time.monotonic()
        if self._stopped or state.gate not in ("idle", "hold", "armed") or now < self._next_try[part] or part in self._asking:
            return
        self._next_try[part] = now + RETRY
        self.epochs[part] = 0
        attempt = self._asking[part] = object()
        self._service.ask(
            keys.drive(part, "take"),
            Taken,
            lambda answer: self._taken(part, attempt, answer),
            request=Take,
            instance=self._service.instance,
        )

    def _taken(self, part: str, attempt: object, answer: Taken | CallFailed) -> None:
        if self._asking.get(part) is not attempt:
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
            epoch=epoch,
        )

    def _driven(self, part: str, attempt: object, epoch: int, answer: Driven | CallFailed) -> None:
        if self._asking.get(part) is not attempt:
            return
        if isinstance(answer, CallFailed) or answer.gate != "armed":
            self._failed(part, str(answer) if isinstance(answer, CallFailed) else f"gate {answer.gate}")
            return
        del self._asking[part]
        self.epochs[part] = epoch
        self._shows_by[part] = time.monotonic() + SHOWS
        self._service.bus.event("info", "armed", f"{part} is under control, epoch {epoch}")

    def _failed(self, part: str, why: str) -> None:
        del self._asking[part]
        self._service.log.info("%s cannot be armed yet: %s", part, why)
