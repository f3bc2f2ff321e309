# SPDX-License-Identifier: Apache-2.0
"""Acts as the controller of a robot_sim under test: records its messages, and sends commands, including invalid ones."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeVar

import numpy as np

from bus_schema import VERSION, Refused, decode, encode, encoding_of, keys
from bus_schema.messages import Clock, Commands, EStop, Message, Mode, Order, PartStatus, State, Tick
from bus_schema.rpc import Driven, Empty, Reply, Request, Stat, Take, Taken, WithEpoch
from mobee.arrays import Array
from mobee.robot.robot import Robot
from services.common import rpc
from services.common.observe import Received, listen
from services.common.rpc import CallFailed
from services.common.service import Service

ANSWER = 1.0  # s within which a call is answered and a stop is obeyed
TTL = 200  # ms, of a command

_M = TypeVar("_M", bound=Message)
_R = TypeVar("_R", bound=Reply)


OPERATOR = "mobee_conform"


class Broken(Exception):
    """Raised if the robot breaks a rule of the bus contract (docs/hardware.md). The message contains what was observed and expected."""


class Player:
    """Acts as the controller of a robot_sim under test, and records the messages that arrive.

    `ticks`: pairs of the monotonic time of arrival [s] and the `Tick` message. `clocks`, `stops`: the `Clock` and `EStop` messages.
    `states`: lists of `State` messages, by part. `refused`: texts about messages that are not valid. `epochs`: newest epoch of each
    part, by part; every `take` of a part gives the ownership a new number, the epoch.
    """

    def __init__(self, service: Service, robot: Robot) -> None:
        self.service, self.robot = service, robot
        self.ticks: list[tuple[float, Tick]] = []  # with the monotonic time of arrival, s
        self.clocks: list[Clock] = []
        self.states: dict[str, list[State]] = {part: [] for part in robot.parts}
        self.stops: list[EStop] = []
        self.refused: list[str] = []  # streams that the contract does not allow
        self.epochs = dict.fromkeys(robot.parts, 0)
        self._seq = 0
        self._subscribe(Tick, lambda received, tick: self.ticks.append((received.at, tick)))
        self._subscribe(Clock, lambda received, clock: self.clocks.append(clock))
        self._subscribe(EStop, lambda received, stop: self.stops.append(stop))
        for part in robot.parts:
            self._subscribe(State, partial(self._note_state, part), part)

    def _note_state(self, part: str, received: Received, state: State) -> None:
        self.states[part].append(state)

    def _subscribe(self, cls: type[_M], note: Callable[[Received, _M], object], part: str = "") -> None:
        size = len(self.robot.part(part)) if part else None

        def read(received: Received) -> None:
            try:
                message = decode(cls, received.payload, received.encoding, part=size, robot=len(self.robot.motors))
            except Refused as refused:
                self.refused.append(f"{received.key}: {refused}")
            else:
                note(received, message)

        listen(self.service.bus.session, cls.stream.keys(part) if part else cls.stream.key(), read)

    # Time

    def wait(self, seconds: float) -> None:
        """Wait for `seconds`, and record the messages that arrive."""
        self.service.spin(time.monotonic() + seconds)

    def until(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Wait until the condition is true, and return True; return False if it is still false after `seconds`."""
        end = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > end:
                return False
            self.wait(0.005)
        return True

    @property
    def tick(self) -> Tick:
        """The newest tick. Raises Broken if there is none."""
        if not self.ticks:
            raise Broken(f"nothing valid arrives on {Tick.stream.key()!r}{self._why()}")
        return self.ticks[-1][1]

    def _why(self) -> str:
        return f": {self.refused[-1]}" if self.refused else ": publish a Tick in every tick"

    def status(self, part: str) -> PartStatus:
        """Return the status of a part in the newest tick."""
        return self.tick.parts[part]

    def q(self, part: str) -> Array:
        """Return the motor positions of a part in the newest tick, (n_part,) rad."""
        return np.array(self.tick.q)[self.robot.part(part).slice]

    # Calls

    def call(self, key: str, request: type[Request], reply: type[_R], **fields: Any) -> _R:
        """Call robot_sim as its controller, and return the reply.

        `key`: key of the call on the bus. `request`, `reply`: types of request and reply. `fields`: fields of the request. Raises
        services.common.rpc.CallFailed if the call is refused, or if no valid reply comes within 1 s (ANSWER).
        """
        return self.service.call(key, request, reply, timeout=ANSWER, **fields)

    def call_as_operator(self, key: str, request: type[Request], reply: type[_R]) -> _R:
        """Call robot_sim as an operator (a person), for calls that a controller may not make; return the reply.

        `key`: key of the call on the bus. `request`, `reply`: types of request and reply. Raises services.common.rpc.CallFailed if the call
        is refused, or if no valid reply comes within 1 s (ANSWER).
        """
        return rpc.call(self.service.bus.session, OPERATOR, key, request, reply, timeout=ANSWER)

    def stat(self) -> Stat:
        """Return the status of robot_sim, as it answers the call `stat`."""
        return self.call(keys.service_rpc("robot_sim", "stat"), Empty, Stat)

    def take(self, part: str, instance: str = "") -> int:
        """Take the drive of a part (the right to command its motors), and return its new epoch, the number of the ownership.

        `instance`: id of the process that becomes the owner; empty: this one.
        """
        taken = self.call(keys.drive(part, "take"), Take, Taken, instance=instance or self.service.instance)
        self.epochs[part] = taken.epoch
        return taken.epoch

    def drive(self, part: str, verb: str, epoch: int | None = None) -> str:
        """Call arm, release or hold (`verb`) for the drive of a part, and return the new state of its gate.

        The gate is the check of a part's commands before its motors: after arm the part follows commands, after hold it stands still,
        release ends the ownership. `epoch`: number of the ownership; None: the number that the last `take` of this part returned.
        """
        epoch = self.epochs[part] if epoch is None else epoch
        return self.call(keys.drive(part, verb), WithEpoch, Driven, epoch=epoch).gate

    @contextmanager
    def armed(self, part: str) -> Iterator[None]:
        """Become the owner of a part and arm it (it follows commands), for the block of a `with` statement; release it at the end.

        Raises Broken if robot_sim does not arm the part.
        """
        self.take(part)
        gate = self._armed_when_known(part)
        if gate != "armed":
            raise Broken(f"arm of {part} answers gate {gate!r}, expected 'armed'")
        try:
            yield
        finally:
            self.take(part)
            self.drive(part, "release")

    def _armed_when_known(self, part: str) -> str:
        """Arm a part; the liveliness token of this process may reach the robot after the call, which then refuses with 'no_token'."""
        end = time.monotonic() + ANSWER
        while True:
            try:
                return self.drive(part, "arm")
            except CallFailed as refused:
                if refused.code != "no_token" or time.monotonic() > end:
                    raise
                self.wait(0.01)

    # Commands

    def send(self, part: str, mode: Mode, ref: Array, **changed: Any) -> int:
        """Publish one command to a part, and return its sequence number.

        `ref`: (n_part,), positions [rad], velocities [rad/s] or torques [N m] by `mode`. `changed`: fields that differ from those of a
        valid command, by name.
        """
        whole = np.zeros(len(self.robot.motors))
        whole[self.robot.part(part).slice] = ref
        self._seq += 1
        epoch = changed.pop("epoch", self.epochs[part])
        fields: dict[str, Any] = {
            "v": VERSION,
            "run": self.tick.run,
            "src": "controller",
            "seq": self._seq,
            "k": self.tick.k,
            "t": self.tick.t,
            "tw": time.monotonic_ns(),
            "re_k": self.tick.k,
            "parts": {part: Order(epoch, mode)},
            "ref": whole.tolist(),
            "ttl": TTL,
            "answer": None,
        }
        message = Commands(**{**fields, **changed})
        self.service.bus.session.put(Commands.stream.key(), encode(message), encoding=encoding_of(Commands))
        return message.seq

    def keep(self, part: str, mode: Mode, ref: Callable[[], Array], seconds: float, **changed: Any) -> None:
        """For `seconds` s, answer every tick with a valid command to a part.

        `ref`: returns the position [rad] or velocity [rad/s] to command, (n_part,), by `mode`. `changed`: as in `send`.
        """
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            seen = self.tick.k
            self.send(part, mode, ref(), **changed)
            self.until(partial(self._is_after, seen), ANSWER)

    def _is_after(self, k: int) -> bool:
        return self.tick.k > k
