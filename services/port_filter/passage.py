"""Forwards states to the clients, and their commands to the robot unless the reflex is active."""

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

REST = 0.1  # s for which a reference has stayed the same before it is said to rest


class Moves:
    """Watches the commands of one part."""

    def __init__(self) -> None:
        self._reference: list[float] | None = None  # of position commands; None: the part was commanded otherwise, or not at all
        self._since = 0  # ns, when the reference became what it is
        self._moving = False

    def begins(self, command: Command, t: int) -> bool:
        """Whether this command begins a position move; t ns of the bus clock."""
        if command.mode != "position":
            self._reference, self._moving = None, False
            return False
        if command.ref == self._reference:
            self._moving = self._moving and t - self._since < REST * 1e9
            return False
        begins = not self._moving
        self._reference, self._since, self._moving = command.ref, t, True
        return begins

    def forget(self) -> None:
        """The part is out of the client's hands."""
        self._reference, self._moving = None, False


REMEMBERED = 1000  # commands under way, at most


class Stream:
    """One stream with one numbering, and which number of the client's is behind each."""

    def __init__(self, bus: Bus, part: str) -> None:
        self._stream = bus.publisher(Command, part)
        self._seq = 0
        self._theirs: OrderedDict[int, int] = OrderedDict()

    def forward(self, command: Command) -> None:
        """Pass a client's command on."""
        self._theirs[self._seq] = command.seq
        if len(self._theirs) > REMEMBERED:
            self._theirs.popitem(last=False)
        self.put(command.epoch, command.re_k, command.mode, command.ref, command.ttl)

    def put(self, epoch: int, re_k: int, mode: Mode, reference: list[float], ttl: int) -> None:
        """Command the part."""
        self._stream.put(epoch=epoch, re_k=re_k, mode=mode, ref=reference, ttl=ttl)
        self._seq += 1

    def theirs(self, seq: int) -> int:
        """The client's number of what robot_sim knows as `seq`; -1 when it was none of the client's."""
        return self._theirs.get(seq, -1)


STALE = 100_000_000  # ns: a part whose state is older cannot be judged


class Passage:
    """The streams of all parts."""

    def __init__(
        self, service: Service, twin: Service, robot: Robot, epochs: dict[str, int], why_cut: Callable[[], str], mark: Callable[[], object]
    ) -> None:
        """`epochs`: the drive epoch of each part; `why_cut` as for DriveDesk; `mark` is called when a position move begins."""
        self._service, self._twin, self._robot = service, twin, robot
        self._epochs, self._why_cut, self._mark = epochs, why_cut, mark
        self._parts: dict[str, PartStatus] = {}
        self._q: Array = robot.home
        self.answered: Callable[[Commands, Answer], None] = lambda commands, answer: None  # lockstep: a tick was, along with commands
        self.is_stale = False  # the states are too old to be judged, so that no command may follow them
        self.commands = {part: Stream(service.bus, part) for part in robot.parts}
        self._moves = {part: Moves() for part in robot.parts}
        self._newest = dict.fromkeys(robot.parts, (0, -1))  # epoch and number of the newest command of a client
        self._streams = {part: twin.bus.publisher(State, part) for part in robot.parts}
        self._tick = twin.bus.publisher(Tick)
        twin.on_newest(Commands, self._down_all)
        for part in robot.parts:
            twin.on_newest(Command, partial(self._down, part), part)
            service.on_newest(State, partial(self._up, part), part)

    def note(self, tick: Tick) -> None:
        """A tick begins, with the body as it is."""
        self._parts, self._q = tick.parts, np.array(tick.q)
        self.is_stale = tick.t - min(state.t for state in tick.parts.values()) > STALE

    def pass_on(self, tick: Tick) -> None:
        """Tell the clients of it."""
        parts = {part: self._as_told(part, state) for part, state in tick.parts.items()}
        self._tick.put(dt=tick.dt, mode=tick.mode, rate=tick.rate, q=tick.q, parts=parts)

    def q(self) -> Array:
        """Motor positions as the encoders say, (n,) rad."""
        return self._q

    def obeys(self, part: str) -> bool:
        """Whether robot_sim does with the part what this filter commands, as of the newest tick."""
        state = self._parts.get(part)
        return state is not None and state.gate == "armed" and state.epoch == self._epochs[part]

    def forget_moves(self) -> None:
        """The clients are cut off: what they command next is a new motion."""
        for moves in self._moves.values():
            moves.forget()

    def forget(self) -> None:
        """A new run."""
        self._parts = {}
        self.is_stale = False
        self._newest = dict.fromkeys(self._newest, (0, -1))
        self.forget_moves()

    def _down(self, part: str, command: Command) -> None:
        """A client's command."""
        epoch, seq = self._newest[part]
        if why := self._why_cut():
            self._twin.bus.reject("reflex", f"{part}: {why}")
        elif self.is_stale:
            self._twin.bus.reject("stale", f"{part}: the robot's states are too old to be judged")
        elif command.epoch != self._epochs[part]:
            self._twin.bus.reject("epoch", f"{part}: epoch {command.epoch}, in force is {self._epochs[part]}")
        elif command.epoch == epoch and command.seq <= seq:
            self._twin.bus.reject("seq", f"{part}: seq {command.seq} after {seq}")
        else:
            self._newest[part] = (command.epoch, command.seq)
            if self._moves[part].begins(command, self._service.bus.t):
                self._mark()
            self.commands[part].forward(command)

    def _down_all(self, commands: Commands) -> None:
        """A client's commands to several parts."""
        for part, order in commands.parts.items():
            if part not in self._robot.parts:
                self._twin.bus.reject("part", f"Commands to {part}: this robot has {', '.join(self._robot.parts)}")
                continue
            fields = {name: getattr(commands, name) for name in ("v", "run", "src", "seq", "k", "t", "tw", "re_k", "ttl")}
            one = Command(**fields, epoch=order.epoch, mode=order.mode, ref=commands.ref[self._robot.parts[part].slice])
            self._down(part, one)
        if commands.answer is not None:
            self.answered(commands, commands.answer)

    def _up(self, part: str, state: State) -> None:
        """The robot's state, as the client's own robot would be in."""
        self._twin.bus.run = self._service.bus.run
        told = self._as_told(part, state)
        self._streams[part].put(
            k=state.k,
            t=state.t,
            q=state.q,
            dq=state.dq,
            tau=state.tau,
            mode=told.mode,
            gate=told.gate,
            faults=told.faults,
            epoch=told.epoch,
            cmd_seq=told.cmd_seq,
            cmd_age=told.cmd_age,
        )

    def _as_told(self, part: str, state: State | PartStatus) -> PartStatus:
        """How a client sees the part: while it is cut off, in hold."""
        is_cut = state.gate == "armed" and bool(self._why_cut())
        seq = -1 if is_cut else self.commands[part].theirs(state.cmd_seq)
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
