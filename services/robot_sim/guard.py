# SPDX-License-Identifier: Apache-2.0
"""The gates of all parts on the bus: commands, ownership, liveliness, emergency stop."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from bus_schema import VERSION, Refused, keys
from bus_schema.messages import Answer, Command, Commands, EStop
from bus_schema.rpc import Done, Driven, Empty, Take, Taken, WithEpoch
from mobee.arrays import Array
from mobee.robot.robot import Robot
from services.common.inbox import CROWDED_WITH_STOPS
from services.common.service import CallRefused, Service
from services.robot_sim.gate import LOCKED_TTL, Gate, Limits, Order, orders_of, refused_as_call
from services.robot_sim.kinematic import Backend

INDISPENSABLE = ("model", "router", "launcher")  # without any of them the whole robot holds
ESTOP_PERIOD = 0.1  # s between two repetitions of an emergency stop


class Guard:
    """One gate a part."""

    def __init__(self, service: Service, robot: Robot, backend: Backend, dt: float) -> None:
        self._service, self._robot, self._backend, self._dt = service, robot, backend, dt
        self._where = {name: part.slice for name, part in robot.parts.items()}
        self._estop_reason = ""
        self._waiting: list[tuple[str, Order]] = []  # lockstep: orders for the next tick
        self._on_answer: Callable[[str, int, Answer], None] = lambda who, re_k, answer: None
        if not service.locked:
            self._newest = service.bus.latest(Commands)
        self._estop = service.bus.publisher(EStop, delivery="LATEST")
        # Epochs grow over restarts too: what a controller holds from before never fits again.
        self.gates = {part: self._gate(part, time.time_ns() // 1_000_000) for part in robot.parts}
        self._declare()

    def on_answer(self, handler: Callable[[str, int, Answer], None]) -> None:
        """Lockstep: call handler(service, tick, answer) for the answer in a message of commands."""
        self._on_answer = handler

    def reset(self) -> None:
        """A new run: all gates are idle and without owner; a latched emergency stop stays."""
        self.gates = {part: self._gate(part, gate.epoch) for part, gate in self.gates.items()}
        self._waiting.clear()
        if self._estop_reason:
            self._stop_all()

    def tick(self, k: int) -> None:
        """Give the commands that are in force in tick k to the motors."""
        now = time.monotonic_ns()
        motors = self._backend.motors
        q, velocities = motors.q, motors.motor_velocities
        if not self._service.locked and (commands := self._newest.take()) is not None:
            for part, order in self._orders(commands):
                self._admit(part, order, q, k - 1)
        for part, gate in self.gates.items():
            where = self._where[part]
            drive = gate.tick(k, now, q[where], velocities[where])
            motors.command(where, drive.mode, drive.reference)

    def admit_waiting(self) -> None:
        """Lockstep: admit the commands that answer this tick, in the order of names, whichever came first."""
        q = self._backend.motors.q
        for part, order in sorted(self._waiting, key=lambda item: (item[0], item[1].src, item[1].seq)):
            self._admit(part, order, q, self._service.bus.k)
        self._waiting.clear()

    def hold_dependents(self, who: str) -> None:
        """Let the parts hold that depend on a late service."""
        if who in INDISPENSABLE:
            self.hold_all(f"{who} is late")
        for gate in self.gates.values():
            if gate.owner is not None and gate.owner[0] == who:
                gate.force_hold(f"its owner {who} is late")

    def hold_all(self, why: str) -> None:
        """Let every part hold at once."""
        for gate in self.gates.values():
            gate.force_hold(why)

    def _gate(self, part: str, epoch: int) -> Gate:
        def report(code: str, text: str, values: dict[str, float]) -> None:
            self._service.bus.event("warning", code, text, **values)

        ttl_ticks = LOCKED_TTL if self._service.locked else None
        return Gate(part, Limits.of(self._robot, part), self._dt, epoch, report, ttl_ticks)

    def _declare(self) -> None:
        service = self._service
        for part in self.gates:
            self._listen(part)
        if service.locked:
            service.on_each(Commands, self._take_commands)
        service.on_request(keys.drive("*", "take"), Take, self._take, part_of_key=True)
        for verb in ("arm", "release", "hold"):
            service.on_request(keys.drive("*", verb), WithEpoch, self._drive, part_of_key=True)
        service.on_each(EStop, self._on_estop, any_run=True, crowd=CROWDED_WITH_STOPS)
        service.on_request(keys.ESTOP_RESET, Empty, self._reset_estop)
        service.on_alive(self._on_alive)

    def _listen(self, part: str) -> None:
        """Subscribe to the stream of clients that drive a single part."""
        service = self._service
        if service.locked:
            service.on_each(Command, lambda command: self._wait(part, Order.of(command)), part, later=True)
        else:
            service.on_newest(Command, lambda command: self._admit_now(part, Order.of(command)), part)

    def _take_commands(self, commands: Commands) -> None:
        for part, order in self._orders(commands):
            self._wait(part, order)
        if commands.answer is not None:
            self._on_answer(commands.src, commands.re_k, commands.answer)

    def _orders(self, commands: Commands) -> Iterable[tuple[str, Order]]:
        try:
            return orders_of(commands, self._robot).items()
        except KeyError as unknown:
            self._service.bus.reject("part", f"Commands to the part {unknown}; this robot has {', '.join(self._robot.parts)}")
            return ()

    def _wait(self, part: str, order: Order) -> None:
        self._waiting.append((part, order))

    def _admit_now(self, part: str, order: Order) -> None:
        self._admit(part, order, self._backend.motors.q, self._service.bus.k)

    def _admit(self, part: str, order: Order, q: Array, k: int) -> None:
        """`q`: (n,) rad, measured positions of all motors; `k`: the present tick."""
        try:
            self.gates[part].admit(order, k, time.monotonic_ns(), q[self._where[part]])
        except Refused as refused:  # reported and counted
            self._service.bus.reject(refused.reason, str(refused))

    def _take(self, request: Take, key: str) -> Taken:
        gate = self.gates[key.split("/")[0]]
        if gate.owner is not None and gate.owner[1] != request.instance and gate.owner[1] in self._service.alive.get(gate.owner[0], ()):
            raise CallRefused("owned", f"{gate.part} belongs to {gate.owner[0]}, which is running and must release it first")
        return Taken(v=VERSION, epoch=gate.take(request.who, request.instance))

    def _drive(self, request: WithEpoch, key: str) -> Driven:
        part, verb = key.split("/")[0], key.split("/")[-1]
        gate = self.gates[part]
        with refused_as_call():
            if verb == "arm":
                self._check_alive(gate)
                gate.arm(request.epoch)
            elif verb == "release":
                gate.release(request.epoch)
            else:
                gate.hold(request.epoch)
        return Driven(v=VERSION, gate=gate.state)

    def _check_alive(self, gate: Gate) -> None:
        """Refuse to arm a part whose owner has no liveliness token, without which its end would not be noticed."""
        if gate.owner is not None and gate.owner[1] not in self._service.alive.get(gate.owner[0], ()):
            raise CallRefused("no_token", f"{gate.part}: no liveliness token alive/{gate.owner[0]}/{gate.owner[1]}: declare it, then arm")

    def _on_alive(self, who: str, instance: str, up: bool) -> None:
        if up:
            return
        for gate in self.gates.values():
            if gate.owner == (who, instance):
                gate.lose_owner()
        if who in INDISPENSABLE:
            self.hold_all(f"{who} is gone")

    def _on_estop(self, message: EStop) -> None:
        own = message.src == self._service.who and message.run == self._service.bus.run
        if message.set and not own and not self._estop_reason:
            self._estop_reason = f"emergency stop by {message.source}: {message.reason}"
            self._stop_all()
            self._repeat_estop()

    def _stop_all(self) -> None:
        for gate in self.gates.values():
            gate.stop(self._estop_reason)

    def _repeat_estop(self) -> None:
        """Publish the stop again and again until it is reset, for services that join late."""
        if self._estop_reason:
            self._estop.put(set=True, source=self._service.who, reason=self._estop_reason[:2000])
            self._service.inbox.at(time.monotonic() + ESTOP_PERIOD, self._repeat_estop)

    def _reset_estop(self, request: Empty, key: str) -> Done:
        if self._estop_reason:
            self._estop_reason = ""
            for gate in self.gates.values():
                gate.reset_stop()
            self._service.bus.event("warning", "estop_reset", f"emergency stop reset by {request.who}")
        # Published in any case: services may remember a stop of an earlier run.
        self._estop.put(set=False, source=request.who, reason="reset")
        return Done(v=VERSION)
