# SPDX-License-Identifier: Apache-2.0
"""Starts the babbler, a client that sends random commands to all parts at once: `python -m experiments.claims.ch4_reflex.babbler`.

It commands positions to the drives, or goals to MoBeE's controller.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Generic, TypeVar

import numpy as np
from msgspec import structs

from bus_schema import keys
from bus_schema.messages import Clock, Command, Message, Motion, State, Turn
from bus_schema.rpc import Driven, Goal, Started, Take, Taken, WithEpoch
from experiments.claims.ch4_reflex.babbler.config import Config
from experiments.claims.ch4_reflex.babbling_trial import COMMANDS, Commanded, CommandLog, Ending, PositionMove, Targets
from mobee import load_robot
from mobee.arrays import Array
from mobee.robot.robot import Robot
from services.common.config import load_config
from services.common.entry import explained
from services.common.lockstep import Participant
from services.common.rpc import CallFailed
from services.common.service import Service

TTL = 100  # ms
REST = 1.0  # s after the end of a move, in which the motors arrive
RETRY_PERIOD = 0.1  # s of robot time between attempts to arm a part

_M = TypeVar("_M", bound=Message)


class BabblerNode:
    """Commands random postures one after the other, and writes each command that has ended to the log.

    In lockstep each tick waits for the answer of this service, which answers when it has sent its commands for the tick.
    """

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._commands = 0
        self._log = CommandLog(Path(config.run_dir) / COMMANDS)
        self._participant = Participant(service)
        targets = Targets(robot, config.seed)
        if config.at == "drives":
            self._mover: AtDrives | AtGoals = AtDrives(service, robot, targets, config.speed, self._note)
        else:
            self._mover = AtGoals(service, robot, targets, self._note)
        service.describe = lambda: (f"{self._commands} commands", {"commands": self._commands})
        if service.locked and config.at == "goals":  # after the controller, which reports the end of motions
            service.on_turn(self._tick)
        else:
            service.on_clock(self._tick)

    def _tick(self, now: Clock | Turn) -> None:
        if now.k > 0:  # tick 0 gathers the participants
            self._mover.move(now.k, now.dt * 1e-9)
        self._participant.done(now.k)

    def _note(self, commanded: Commanded) -> None:
        self._commands += 1
        self._log.note(commanded)


def main(argv: Sequence[str] | None = None) -> None:
    """Run the client until the system ends.  `argv`: command-line arguments; None: those of the process."""
    config = load_config(Config, argv, "experiments.claims.ch4_reflex.babbler")
    with explained("experiments.claims.ch4_reflex.babbler"):
        robot = load_robot(config.robot)
        with Service("babbler", config, robot) as service, ExitStack() as stack:
            client = service
            if config.robot_of != config.namespace:
                theirs = structs.replace(config, namespace=config.robot_of)
                client = stack.enter_context(Service("babbler", theirs, robot, inbox=service.inbox))
            BabblerNode(client, config, robot)
            client.ready()
            if client is not service:
                service.ready()
            service.run()


class PartStreams(Generic[_M]):
    """The newest message of one class from each part; in lockstep (every tick waits for all participants) that of the current tick.

    `newest`: the messages, by part.  `cls`: the class of message.  When the robot starts a new run, all messages are removed.
    """

    def __init__(self, service: Service, robot: Robot, cls: type[_M]) -> None:
        self.newest: dict[str, _M] = {}
        self._parts = len(robot.parts)
        for part in robot.parts:
            service.on_newest(cls, self._noter(part), part)
        service.on_run(self.newest.clear)

    def are_complete(self) -> bool:
        """Whether every part has sent a message in this run."""
        return len(self.newest) == self._parts

    def _noter(self, part: str) -> Callable[[_M], None]:
        def note(message: _M) -> None:
            self.newest[part] = message

        return note


class AtDrives:
    """Sends position commands to the drives of all parts in every tick, along minimum-jerk moves from posture to posture.

    If the safety layer (the checks of commands before the motors) ends a move, all parts are armed (released to follow commands) again, and
    the next move begins where the robot is.
    """

    def __init__(self, service: Service, robot: Robot, targets: Targets, speed: float, note: Callable[[Commanded], None]) -> None:
        """`targets`: the random postures.

        `speed`: share of the motors' maximum speed.  `note` is called with every command that has ended.
        """
        self._service, self._robot, self._targets, self._note = service, robot, targets, note
        self._speed = speed * np.array([motor.max_velocity for motor in robot.motor_table])
        self._states = PartStreams(service, robot, State)
        self._commands = {part: service.bus.publisher(Command, part) for part in robot.parts}
        self._epochs = dict.fromkeys(robot.parts, 0)
        self._retry_at = 0  # tick
        self._reference = self._target = robot.home
        self._move = PositionMove(robot.home, robot.home, self._speed)
        self._begin = 0  # tick of the current command, 0: none
        self._is_refused = True  # the safety layer ended it
        service.on_run(self._forget)

    def move(self, k: int, dt: float) -> None:
        """Send the position commands of tick `k`.  `dt`: duration of a tick [s].

        If a part is not armed (released to follow commands), arm the parts that are not armed, and send no commands.
        """
        if not self._states.are_complete():
            return
        states = self._states.newest
        if not all(states[part].gate == "armed" and states[part].epoch == epoch for part, epoch in self._epochs.items()):
            self._is_refused = True
            self._arm(k, dt)
            return
        if self._is_refused:  # armed again: the pose in which the safety layer left the robot is known now
            self._end(k, "refused")
            self._start(k, np.concatenate([states[part].q for part in self._robot.parts]))
        elif (k - self._begin) * dt >= self._move.duration + REST:
            self._end(k, "over")
            self._start(k, self._reference)
        self._send(k, dt)

    def _start(self, k: int, here: Array) -> None:
        limits = self._robot.limits
        self._target, self._begin, self._is_refused = self._targets.next(), k, False
        self._move = PositionMove(here.clip(limits[:, 0], limits[:, 1]), self._target, self._speed)

    def _end(self, k: int, ending: Ending) -> None:
        if self._begin:
            self._note(Commanded(self._begin, k, self._target.tolist(), dict.fromkeys(self._robot.parts, ending)))

    def _send(self, k: int, dt: float) -> None:
        self._reference = self._move.at((k - self._begin) * dt)
        for part, publisher in self._commands.items():
            where = self._robot.parts[part].slice
            publisher.put(epoch=self._epochs[part], re_k=k, mode="position", ref=self._reference[where].tolist(), ttl=TTL)

    def _arm(self, k: int, dt: float) -> None:
        """Take the ownership of each part's drive, and switch it on ("arm" it) for commands, if this is not done yet.

        The first refusal ends the attempt; the next one is made after RETRY_PERIOD.  Waits for each answer, so that it belongs to tick `k`.
        """
        if k < self._retry_at:
            return
        self._retry_at = k + round(RETRY_PERIOD / dt)
        for part, state in self._states.newest.items():
            if state.gate == "armed" and state.epoch == self._epochs[part]:
                continue
            try:
                taken = self._service.call(keys.drive(part, "take"), Take, Taken, instance=self._service.instance)
                self._service.call(keys.drive(part, "arm"), WithEpoch, Driven, epoch=taken.epoch)
                self._epochs[part] = taken.epoch
            except CallFailed as failed:
                self._service.log.info("%s cannot be armed yet: %s", part, failed)
                return  # a refusal of one part applies to all parts

    def _forget(self) -> None:
        self._epochs = dict.fromkeys(self._epochs, 0)
        self._retry_at = self._begin = 0


class AtGoals:
    """Sends random postures as goals to the controller; the next posture follows when the motions of all parts have ended."""

    def __init__(self, service: Service, robot: Robot, targets: Targets, note: Callable[[Commanded], None]) -> None:
        """`targets`: the random postures.  `note` is called with every command that has ended."""
        self._service, self._robot, self._targets, self._note = service, robot, targets, note
        self._motions = PartStreams(service, robot, Motion)
        self._epochs: dict[str, int] = {}
        self._begin, self._number = -1, 0  # tick of the current command, -1: none
        self._target: Array = robot.home
        self._endings: dict[str, Ending] = {}
        service.on_run(self._forget)

    def move(self, k: int, dt: float) -> None:
        """Send the goals of the next posture in tick `k`, if every part has ended its motion.  `dt`: duration of a tick [s], not used."""
        if not self._motions.are_complete() or not self._owns_all():
            return
        if self._begin >= 0:
            self._note_endings()
            if len(self._endings) < len(self._robot.parts):
                return
            self._note(Commanded(self._begin, k, self._target.tolist(), dict(self._endings)))
            self._begin = -1
        if all(motion.status != "held" for motion in self._motions.newest.values()):
            self._start(k)

    def _note_endings(self) -> None:
        """Note the parts whose motion has ended."""
        for part, motion in self._motions.newest.items():
            if part in self._endings or motion.k <= self._begin:
                continue
            if motion.status == "settled" or motion.status == "timeout":
                self._endings[part] = motion.status
            elif motion.status not in ("moving", "suspended"):
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
                self._forget()  # the controller does not know this process any more: take all parts again
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


if __name__ == "__main__":
    main()
