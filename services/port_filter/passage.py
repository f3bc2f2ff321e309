"""What passes through the filter: states to the clients, and their commands to the robot unless they are cut off."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bus_schema import keys
from bus_schema.messages import Command, State
from mobee.robot.robot import Array, Robot
from services.common.service import Service
from services.port_filter.commands import Commands
from services.port_filter.moves import Moves


class Passage:
    """The streams of all parts."""

    def __init__(
        self, service: Service, twin: Service, robot: Robot, epochs: dict[str, int], why_cut: Callable[[], str], mark: Callable[[], object]
    ) -> None:
        """`epochs`: the drive epoch of each part; `why_cut` as for DriveDesk; `mark` is called when a position move begins."""
        self._service, self._twin, self._robot = service, twin, robot
        self._epochs, self._why_cut, self._mark = epochs, why_cut, mark
        self.states: dict[str, State] = {}
        self.is_stale = False  # the states are too old to be judged, so that no command may follow them
        self.commands = {part: Commands(service.bus, part) for part in robot.parts}
        self._moves = {part: Moves() for part in robot.parts}
        self._newest = dict.fromkeys(robot.parts, (0, -1))  # epoch and number of the newest command of a client
        self._streams = {part: twin.bus.publisher(keys.state(part), State, twin.bus.control) for part in robot.parts}
        for part in robot.parts:
            twin.on_newest(keys.command(part), Command, lambda command, part=part: self._down(part, command), part=part)
            service.on_newest(keys.state(part), State, lambda state, part=part: self._up(part, state), part=part)

    @property
    def is_complete(self) -> bool:
        """Whether every part has reported in this run."""
        return len(self.states) == len(self._robot.parts)

    def q(self) -> Array:
        """Motor positions as the encoders say, (n,) rad; only when it is complete."""
        q = np.empty(len(self._robot.motors))
        for name, part in self._robot.parts.items():
            q[part.slice] = self.states[name].q
        return q

    def obeys(self, part: str) -> bool:
        """Whether robot_sim does with the part what this filter commands, as of its newest state."""
        state = self.states[part]
        return state.gate == "armed" and state.epoch == self._epochs[part]

    def forget_moves(self) -> None:
        """The clients are cut off: what they command next is a new motion."""
        for moves in self._moves.values():
            moves.forget()

    def forget(self) -> None:
        """A new run."""
        self.states.clear()
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

    def _up(self, part: str, state: State) -> None:
        """The robot's state, as the client's own robot would be in: while it is cut off, in hold."""
        self.states[part] = state
        self._twin.bus.run = self._service.bus.run
        is_cut = state.gate == "armed" and bool(self._why_cut())
        seq = -1 if is_cut else self.commands[part].theirs(state.cmd_seq)
        self._streams[part].put(
            k=state.k,
            t=state.t,
            q=state.q,
            dq=state.dq,
            tau=state.tau,
            mode="hold" if is_cut else state.mode,
            gate="hold" if is_cut else state.gate,
            faults=state.faults,
            epoch=state.epoch,
            cmd_seq=seq,
            cmd_age=state.cmd_age if seq >= 0 else -1,
        )
