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


class Drives:
    """The drive epoch of each part, and whether robot_sim obeys it."""

    def __init__(self, service: Service, robot: Robot) -> None:
        self._service = service
        self.epochs: dict[str, int] = dict.fromkeys(robot.parts, 0)
        self._next_try = dict.fromkeys(robot.parts, 0.0)
        self._armed_at = dict.fromkeys(robot.parts, -1)  # tick

    def armed(self, part: str, state: State) -> bool:
        """Whether the part does what this controller commands, as of its newest state."""
        return self.epochs[part] > 0 and state.gate == "armed" and state.epoch == self.epochs[part]

    def arming(self, part: str, k: int) -> bool:
        """Whether the part was armed so recently that its state cannot show it yet."""
        return 0 <= k - self._armed_at[part] <= 2

    def forget(self) -> None:
        """A new run of robot_sim: all epochs are void."""
        self.epochs = dict.fromkeys(self.epochs, 0)
        self._armed_at = dict.fromkeys(self._armed_at, -1)

    def try_arm(self, part: str, state: State, k: int) -> bool:
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
            self._armed_at[part] = k
            self._service.bus.event("info", "armed", f"{part} is under control, epoch {self.epochs[part]}")
        return reply.gate == "armed"
