"""Takes and arms the drives of all parts, and again after each hold."""

from __future__ import annotations

import time
from collections.abc import Callable

from bus_schema import keys
from bus_schema.messages import EStop, PartStatus
from bus_schema.rpc import Driven, Take, Taken, WithEpoch
from mobee.robot.robot import Robot
from services.common.rpc import CallFailed
from services.common.service import Service

RETRY = 0.2  # s between attempts to arm a part
SHOWS = 0.1  # s after which the state of a part must show that it was armed


class Drives:
    """The drive epoch of each part, and whether robot_sim obeys it.

    Never waits for an answer: while one part is armed the others need their commands.  In lockstep its times are those of the bus.
    """

    def __init__(self, service: Service, robot: Robot) -> None:
        self._service, self._patience = service, service.patience
        self.epochs: dict[str, int] = dict.fromkeys(robot.parts, 0)
        self._next_try = dict.fromkeys(robot.parts, 0.0)
        self._shows_by = dict.fromkeys(robot.parts, 0.0)
        self._stopped = False  # an emergency stop outlives a robot_sim that dies under it
        self._asking: dict[str, object] = {}  # part -> mark of the attempt under way
        self.answered: Callable[[], None] = lambda: None  # an attempt is over

    @property
    def asking(self) -> bool:
        """Whether an attempt to arm a part is under way."""
        return bool(self._asking)

    def _now(self) -> float:
        return self._service.bus.t * 1e-9 if self._service.locked else time.monotonic()

    def armed(self, part: str, state: PartStatus) -> bool:
        """Whether the part does what this controller commands, as of its newest state; or will have, if it was armed just now."""
        if self.epochs[part] == 0:
            return False
        if state.epoch == self.epochs[part] and state.gate == "armed":
            self._shows_by[part] = 0.0
            return True
        return self._now() < self._shows_by[part]

    def forget(self) -> None:
        """A new run of robot_sim: all epochs are void, and answers still to come are too."""
        self.epochs = dict.fromkeys(self.epochs, 0)
        self._next_try = dict.fromkeys(self._next_try, 0.0)
        self._asking.clear()

    def note_stop(self, message: EStop) -> None:
        """An emergency stop, or its reset: between them nothing is armed."""
        self._stopped = message.set

    def can_arm(self, state: PartStatus) -> bool:
        """Whether a part in that state may be taken and armed."""
        return not self._stopped and state.gate in ("idle", "hold", "armed")

    def try_arm(self, part: str, state: PartStatus) -> None:
        """Begin to take and arm a part that is idle or in hold; `armed` says when it is done."""
        now = self._now()
        if not self.can_arm(state) or now < self._next_try[part] or part in self._asking:
            return
        if not self._service.locked or self._service.bus.k > 0:  # tick 0 is repeated until all are there, and its time stands still
            self._next_try[part] = now + RETRY
        self.epochs[part] = 0
        attempt = self._asking[part] = object()
        self._service.ask(
            keys.drive(part, "take"),
            Taken,
            lambda answer: self._taken(part, attempt, answer),
            request=Take,
            timeout=self._patience,
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
            timeout=self._patience,
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
        self._shows_by[part] = self._now() + SHOWS
        self._service.bus.event("info", "armed", f"{part} is under control, epoch {epoch}")
        self.answered()

    def _failed(self, part: str, why: str) -> None:
        del self._asking[part]
        self._service.log.info("%s cannot be armed yet: %s", part, why)
        self.answered()
