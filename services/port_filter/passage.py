# SPDX-License-Identifier: Apache-2.0
"""Forwards states to the clients, and their commands to the robot unless the reflex (the motion back out of contact) is active."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from functools import partial

import numpy as np

from bus_schema.messages import Answer, Command, Commands, Mode, PartStatus, State, Tick
from mobee.arrays import Array
from mobee.robot.robot import Robot
from services.common.bus import Bus
from services.common.service import Service

REST_TIME = 0.1  # s; a reference that has not changed for so long is at rest


class MoveDetector:
    """Detects when a client begins a position move of one part.

    A move begins with the first position command, and when the commanded position changes after at least 0.1 s without a change.
    """

    def __init__(self) -> None:
        self._reference: list[float] | None = None  # of position commands; None: there was none, or another mode
        self._since = 0  # ns, time of the last change of the reference
        self._moving = False

    def begins(self, command: Command, t: int) -> bool:
        """Return whether this command begins a position move. `t`: bus time at which it was received [ns]."""
        if command.mode != "position":
            self._reference, self._moving = None, False
            return False
        if command.ref == self._reference:
            self._moving = self._moving and t - self._since < REST_TIME * 1e9
            return False
        begins = not self._moving or t - self._since >= REST_TIME * 1e9
        self._reference, self._since, self._moving = command.ref, t, True
        return begins

    def forget(self) -> None:
        """Forget the last commanded position, because the client no longer controls the part."""
        self._reference, self._moving = None, False


MAX_REMEMBERED = 1000  # commands in transit, at most


class CommandStream:
    """Publishes the commands of one part to robot_sim, and numbers those of clients and of the reflex in one common sequence.

    The reflex moves the robot back along its past poses when a motion leads into contact.
    For each command of a client it remembers the number that the client gave to the command.
    """

    def __init__(self, bus: Bus, part: str) -> None:
        self._stream = bus.publisher(Command, part)
        self._seq = 0
        self._client_seq: OrderedDict[int, int] = OrderedDict()

    def forward(self, command: Command) -> None:
        """Publish a client's command to robot_sim, with the next number of this stream."""
        self._client_seq[self._seq] = command.seq
        if len(self._client_seq) > MAX_REMEMBERED:
            self._client_seq.popitem(last=False)
        self.put(command.epoch, command.re_k, command.mode, command.ref, command.ttl)

    def put(self, epoch: int, re_k: int, mode: Mode, reference: list[float], ttl: int) -> None:
        """Publish a command to robot_sim.

        `epoch`: number of the filter's ownership of the part, given by robot_sim. `re_k`: tick of the state from which the command was
        computed. `reference`: (n_part,) rad, rad/s or N m, by `mode`. `ttl`: lifetime [ms].
        """
        self._stream.put(epoch=epoch, re_k=re_k, mode=mode, ref=reference, ttl=ttl)
        self._seq += 1

    def client_seq(self, seq: int) -> int:
        """Return the number that a client gave to its command, before the command was forwarded.

        `seq`: number of the command in this stream. The result is -1 if the command is not from a client, or if it is not one of the newest
        1000 (MAX_REMEMBERED) commands of clients.
        """
        return self._client_seq.get(seq, -1)


MAX_STATE_AGE = 100_000_000  # ns; a pose with an older state of a part is not checked


class Streams:
    """Passes the states of all parts to the clients, and the clients' commands to robot_sim.

    `commands`: dict from a part to its stream of commands to robot_sim. `is_stale`: True if the newest state of a part is more than 0.1 s
    older than the tick; the pose is then not checked for contacts and limits, and commands are refused. `answered`: function that is called
    with a client's `Commands` message and the answer in it. Such an answer reports, in lockstep (every tick waits for all participants),
    that the client has finished a tick.
    """

    def __init__(
        self, service: Service, twin: Service, robot: Robot, epochs: dict[str, int], refusal: Callable[[], str], mark: Callable[[], object]
    ) -> None:
        """Begin to forward states and commands.

        `service`: client of the robot. `twin`: acts as the robot in the namespace of the clients. `epochs`: dict from a part to the number
        of the filter's present ownership of its drive. `refusal`: returns the reason why clients may not command now; empty: they may.
        `mark`: called when a position move begins.
        """
        self._service, self._twin, self._robot = service, twin, robot
        self._epochs, self._refusal, self._mark = epochs, refusal, mark
        self._parts: dict[str, PartStatus] = {}
        self._q: Array = robot.home
        self.answered: Callable[[Commands, Answer], None] = lambda commands, answer: None  # lockstep: a tick was, along with commands
        self.is_stale = False  # the states are too old to be checked, so that commands are refused
        self.commands = {part: CommandStream(service.bus, part) for part in robot.parts}
        self._moves = {part: MoveDetector() for part in robot.parts}
        self._newest = dict.fromkeys(robot.parts, (0, -1))  # epoch and number of the newest command of a client
        self._streams = {part: twin.bus.publisher(State, part) for part in robot.parts}
        self._tick = twin.bus.publisher(Tick)
        twin.on_newest(Commands, self._take_commands)
        for part in robot.parts:
            twin.on_newest(Command, partial(self._take_command, part), part)
            service.on_newest(State, partial(self._publish_state, part), part)

    def note(self, tick: Tick) -> None:
        """Store the robot's state that a tick contains."""
        self._parts, self._q = tick.parts, np.array(tick.q)
        self.is_stale = tick.t - min(state.t for state in tick.parts.values()) > MAX_STATE_AGE

    def publish(self, tick: Tick) -> None:
        """Publish the robot's tick to the clients.

        While clients may not command because of the reflex, the message shows each armed part (part that may move) in the state hold,
        without a command.
        """
        parts = {part: self._for_clients(part, state) for part, state in tick.parts.items()}
        self._tick.put(dt=tick.dt, mode=tick.mode, rate=tick.rate, q=tick.q, parts=parts)

    def q(self) -> Array:
        """Return the measured motor positions of the newest tick, (n,) rad."""
        return self._q

    def follows(self, part: str) -> bool:
        """Return whether a part follows the filter's commands: it is armed (it may move) in the newest tick, and the filter owns it."""
        state = self._parts.get(part)
        return state is not None and state.gate == "armed" and state.epoch == self._epochs[part]

    def forget_moves(self) -> None:
        """Forget the last commanded positions of the clients, because the clients have lost control.

        The next position command to a part therefore counts as the beginning of a new move (`MoveDetector`).
        """
        for moves in self._moves.values():
            moves.forget()

    def forget(self) -> None:
        """Forget all states and commands, because a new run has begun."""
        self._parts = {}
        self.is_stale = False
        self._newest = dict.fromkeys(self._newest, (0, -1))
        self.forget_moves()

    def _take_command(self, part: str, command: Command) -> None:
        """Forward or refuse a client's command to one part."""
        epoch, seq = self._newest[part]
        if why := self._refusal():
            self._twin.bus.reject("reflex", f"{part}: {why}")
        elif self.is_stale:
            self._twin.bus.reject("stale", f"{part}: the robot's states are too old to check the pose")
        elif command.epoch != self._epochs[part]:
            self._twin.bus.reject("epoch", f"{part}: epoch {command.epoch}, in force is {self._epochs[part]}")
        elif command.epoch == epoch and command.seq <= seq:
            self._twin.bus.reject("seq", f"{part}: seq {command.seq} after {seq}")
        else:
            self._newest[part] = (command.epoch, command.seq)
            if self._moves[part].begins(command, self._service.bus.t):
                self._mark()
            self.commands[part].forward(command)

    def _take_commands(self, commands: Commands) -> None:
        """Forward or refuse a client's commands to several parts."""
        for part, order in commands.parts.items():
            if part not in self._robot.parts:
                self._twin.bus.reject("part", f"Commands to the part {part}; this robot has {', '.join(self._robot.parts)}")
                continue
            fields = {name: getattr(commands, name) for name in ("v", "run", "src", "seq", "k", "t", "tw", "re_k", "ttl")}
            one = Command(**fields, epoch=order.epoch, mode=order.mode, ref=commands.ref[self._robot.parts[part].slice])
            self._take_command(part, one)
        if commands.answer is not None:
            self.answered(commands, commands.answer)

    def _publish_state(self, part: str, state: State) -> None:
        """Publish the state of a part to the clients.

        Its `cmd_seq` is the number that the client gave to its command, not the one that the filter gave to it when it forwarded the
        command.
        """
        self._twin.bus.run = self._service.bus.run
        shown = self._for_clients(part, state)
        self._streams[part].put(
            k=state.k,
            t=state.t,
            q=state.q,
            dq=state.dq,
            tau=state.tau,
            mode=shown.mode,
            gate=shown.gate,
            faults=shown.faults,
            epoch=shown.epoch,
            cmd_seq=shown.cmd_seq,
            cmd_age=shown.cmd_age,
        )

    def _for_clients(self, part: str, state: State | PartStatus) -> PartStatus:
        """Return the status of a part for the clients: in hold (not under command) while the reflex is active."""
        is_cut = state.gate == "armed" and bool(self._refusal())
        seq = -1 if is_cut else self.commands[part].client_seq(state.cmd_seq)
        return PartStatus(
            k=state.k,
            t=state.t,
            mode="hold" if is_cut else state.mode,
            gate="hold" if is_cut else state.gate,
            faults=state.faults,
            epoch=state.epoch,
            cmd_seq=seq,
            cmd_age=state.cmd_age if seq >= 0 else -1,
        )
