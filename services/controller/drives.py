"""Ownership of the motors: every part is taken and armed by the controller, and again after each hold."""

from __future__ import annotations

import time

from bus_schema import keys
from bus_schema.messages import State
from bus_schema.rpc import Driven, Take, Taken, WithEpoch
from mobee.robot.robot import Robot
from services.common.rpc import CallFailed
from services.common.service import Service

RETRY = 0.2  # s between attempts to arm a part
SHOWS = 0.1  # s after which the state of a part must show that it was armed


class Drives:
    """The drive epoch of each part, and whether robot_sim obeys it."""

    def __init__(self, service: Service, robot: Robot) -> None:
        self._service = service
        self.epochs: dict[str, int] = dict.fromkeys(robot.parts, 0)
        self._next_try = dict.fromkeys(robot.parts, 0.0)
        self._shows_by = dict.fromkeys(robot.parts, 0.0)

    def armed(self, part: str, state: State) -> bool:
        """Whether the part does what this controller commands, as of its newest state; or will have, if it was armed just now."""
        if self.epochs[part] == 0:
            return False
        if state.epoch == self.epochs[part] and state.gate == "armed":
            self._shows_by[part] = 0.0
            return True
        return time.monotonic() < self._shows_by[part]

    def forget(self) -> None:
        """A new run of robot_sim: all epochs are void."""
        self.epochs = dict.fromkeys(self.epochs, 0)
        self._next_try = dict.fromkeys(self._next_try, 0.0)

    def try_arm(self, part: str, state: State) -> bool:
        """Take and arm a part that is idle or in hold; True when it is armed now."""
        now = time.monotonic()
        if state.gate not in ("idle", "hold", "armed") or now < self._next_try[part]:
            return False
        self._next_try[part] = now + RETRY
        try:
            self.epochs[part] = self._service.call(keys.drive(part, "take"), Take, Taken, instance=self._service.instance).epoch
            reply = self._service.call(keys.drive(part, "arm"), WithEpoch, Driven, epoch=self.epochs[part])
        except CallFailed as error:
            self.epochs[part] = 0
            self._service.log.info("%s cannot be armed yet: %s", part, error)
            return False
        if reply.gate == "armed":
            self._shows_by[part] = time.monotonic() + SHOWS
            self._service.bus.event("info", "armed", f"{part} is under control, epoch {self.epochs[part]}")
        return reply.gate == "armed"
