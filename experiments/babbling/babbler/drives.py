"""Position moves at the drives of all parts: what a program does that knows no MoBeE."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bus_schema import keys
from bus_schema.messages import Command, State
from bus_schema.rpc import Driven, Take, Taken, WithEpoch
from experiments.babbling.babbler.parts import PartStreams
from experiments.babbling.command_log import Commanded, Ending
from experiments.babbling.moved import Targets
from experiments.babbling.trajectory import PositionMove
from mobee.robot.robot import Array, Robot
from services.common.rpc import CallFailed
from services.common.service import Service

TTL = 100  # ms
REST = 1.0  # s behind the end of a move, in which the motors arrive
RETRY = 0.1  # s of robot time between attempts to arm a part


class AtDrives:
    """Commands a position every tick, along the move to the posture that is due."""

    def __init__(self, service: Service, robot: Robot, targets: Targets, speed: float, note: Callable[[Commanded], None]) -> None:
        """`speed`: share of the motors' top speed; `note` hears of every command that has ended."""
        self._service, self._robot, self._targets, self._note = service, robot, targets, note
        self._speed = speed * np.array([motor.max_velocity for motor in robot.motor_table])
        self._states = PartStreams(service, robot, keys.state, State)
        self._commands = {part: service.bus.publisher(keys.command(part), Command, service.bus.control) for part in robot.parts}
        self._epochs = dict.fromkeys(robot.parts, 0)
        self._retry_at = 0  # tick
        self._reference = self._target = robot.home
        self._move = PositionMove(robot.home, robot.home, self._speed)
        self._begin = 0  # tick of the command under way, 0: none
        self._is_refused = True  # it was ended by what guards the robot
        service.on_run(self._forget)

    def move(self, k: int, dt: float) -> None:
        """Tick k, of dt [s]."""
        if not self._states.are_complete():
            return
        states = self._states.newest
        if not all(states[part].gate == "armed" and states[part].epoch == epoch for part, epoch in self._epochs.items()):
            self._is_refused = True
            self._arm(k, dt)
            return
        if self._is_refused:  # only now is it known where what guards the robot has left it
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
        """Take and arm what does not obey; waits for the answers, so that they belong to this tick."""
        if k < self._retry_at:
            return
        self._retry_at = k + round(RETRY / dt)
        for part, state in self._states.newest.items():
            if state.gate == "armed" and state.epoch == self._epochs[part]:
                continue
            try:
                taken = self._service.call(keys.drive(part, "take"), Take, Taken, instance=self._service.instance)
                self._service.call(keys.drive(part, "arm"), WithEpoch, Driven, epoch=taken.epoch)
                self._epochs[part] = taken.epoch
            except CallFailed as failed:
                self._service.log.info("%s cannot be armed yet: %s", part, failed)
                return  # whoever refuses one part now refuses them all

    def _forget(self) -> None:
        self._epochs = dict.fromkeys(self._epochs, 0)
        self._retry_at = self._begin = 0
