"""The same postures as goals of MoBeE's controller, for all parts at once."""

from __future__ import annotations

from collections.abc import Callable

from bus_schema import keys
from bus_schema.messages import Motion
from bus_schema.rpc import Goal, Started, Take, Taken
from experiments.babbling.babbler.parts import PartStreams
from experiments.babbling.command_log import Commanded, Ending
from experiments.babbling.moved import Targets
from mobee.robot.robot import Array, Robot
from services.common.rpc import CallFailed
from services.common.service import Service


class AtGoals:
    """The next posture comes when every part has settled, or has tried for too long."""

    def __init__(self, service: Service, robot: Robot, targets: Targets, note: Callable[[Commanded], None]) -> None:
        """`note` hears of every command that has ended."""
        self._service, self._robot, self._targets, self._note = service, robot, targets, note
        self._motions = PartStreams(service, robot, keys.motion, Motion)
        self._epochs: dict[str, int] = {}
        self._begin, self._number = -1, 0  # tick of the command under way, -1: none
        self._target: Array = robot.home
        self._endings: dict[str, Ending] = {}
        service.on_run(self._forget)

    def move(self, k: int, dt: float) -> None:
        """Tick k, of dt [s]."""
        if not self._motions.are_complete() or not self._owns_all():
            return
        if self._begin >= 0:
            self._look()
            if len(self._endings) < len(self._robot.parts):
                return
            self._note(Commanded(self._begin, k, self._target.tolist(), dict(self._endings)))
            self._begin = -1
        if all(motion.status != "held" for motion in self._motions.newest.values()):
            self._start(k)

    def _look(self) -> None:
        """Which parts have come to an end."""
        for part, motion in self._motions.newest.items():
            if part in self._endings or motion.k <= self._begin:
                continue
            if motion.status == "settled" or motion.status == "timeout":
                self._endings[part] = motion.status
            elif motion.status != "moving":
                self._endings[part] = "refused"

    def _start(self, k: int) -> None:
        self._target, self._begin, self._endings = self._targets.next(), k, {}
        self._number += 1
        for part, epoch in list(self._epochs.items()):
            where = self._robot.parts[part].slice
            try:
                self._service.call(
                    keys.goal(part, "goal"), Goal, Started, epoch=epoch, action_id=f"{self._number}", q=self._target[where].tolist()
                )
            except CallFailed as failed:
                self._service.log.warning("%s refuses: %s", part, failed)
                self._forget()  # whoever refuses does not know this process any more: ask again for all parts
                return

    def _owns_all(self) -> bool:
        for part in self._robot.parts:
            if part in self._epochs:
                continue
            try:
                self._epochs[part] = self._service.call(keys.goal(part, "take"), Take, Taken, instance=self._service.instance).epoch
            except CallFailed as failed:
                self._service.log.info("the goal of %s cannot be taken yet: %s", part, failed)
        return len(self._epochs) == len(self._robot.parts)

    def _forget(self) -> None:
        self._epochs.clear()
        self._begin = -1
