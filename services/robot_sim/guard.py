# SPDX-License-Identifier: Apache-2.0
"""Connects the safety gates of all parts (the last check before the motors) with the bus: commands, ownership, liveliness, stops."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

from bus_schema import VERSION, Refused, keys
from bus_schema.messages import Answer, Command, Commands, EStop
from bus_schema.rpc import Done, Driven, Empty, Take, Taken, WithEpoch
from mobee.arrays import Array
from mobee.robot.robot import Robot
from services.common.emergency_stop import Stop, StopDatagrams, StopLine, StopRecord, replaces
from services.common.inbox import Timer
from services.common.service import CallRefused, Service
from services.robot_sim.gate import LOCKED_TTL, Gate, Limits, Order, orders_of, refused_as_call
from services.robot_sim.kinematic import Backend

INDISPENSABLE = ("model", "router", "launcher")  # without any of them the whole robot holds
ESTOP_PERIOD = 0.1  # s between two repetitions of an emergency stop
CHECK_PERIOD = 0.01  # s between two checks for an emergency stop; there is one in every tick too


class Guard:
    """The safety gates, one for each part (the last check of commands before its motors), and the emergency stop of all parts."""

    def __init__(
        self,
        service: Service,
        robot: Robot,
        backend: Backend,
        dt: float,
        record: StopRecord | None,
        speed: float = 1.0,
        datagrams: StopDatagrams | None = None,
    ) -> None:
        """Make the gates; an emergency stop in the record is in force from the beginning.

        `dt`: the tick, s. `record`: the file that keeps emergency stops; None: a stop ends with this process. `speed`: simulated seconds
        per second of real time. `datagrams`: receives stops as UDP datagrams, without the router; None: stops come only
        by the bus and by the record.
        """
        self._service, self._robot, self._backend, self._dt, self._record = service, robot, backend, dt, record
        self._datagrams, self._speed = datagrams, speed
        self._where = {name: part.slice for name, part in robot.parts.items()}
        self._stop: Stop | None = None if record is None else record.read()
        self._counted = dict.fromkeys(INDISPENSABLE, "")  # instance that was there first: a second token of that name changes nothing
        self._runs = {service.bus.run}  # of this process
        self._waiting: list[tuple[str, Order]] = []  # lockstep: orders for the next tick
        self._on_answer: Callable[[str, int, Answer], None] = lambda who, re_k, answer: None
        if not service.locked:
            self._newest = service.bus.latest(Commands)
        self._estop = service.bus.publisher(EStop)
        self._repetition = Timer(self._repeat_stop)
        # Epochs grow over restarts too, if the clock does: what a controller holds from before does not fit again.
        self.gates = {part: self._gate(part, time.time_ns() // 1_000_000) for part in robot.parts}
        self._line = StopLine(service.second_session())
        self._declare()
        self._watch_line()
        if self._stop is not None:
            self._stop_all(self._stop)

    @property
    def stop_reason(self) -> str:
        """The present emergency stop as a text: who stopped the robot, when and why; empty if the robot is not stopped."""
        return "" if self._stop is None else str(self._stop)

    def on_answer(self, handler: Callable[[str, int, Answer], None]) -> None:
        """Set the function that handles a service's answer to a tick, when this answer is a field of a `Commands` message (in lockstep).

        `handler`: called with the name of the service that answers, the number of the tick, and the answer.
        """
        self._on_answer = handler

    def reset(self) -> None:
        """Begin a new run: all safety gates are idle and without owner.

        An emergency stop is not ended: if there is one, the gates are in the state estop.
        """
        self.gates = {part: self._gate(part, gate.epoch) for part, gate in self.gates.items()}
        self._waiting.clear()
        self._runs.add(self._service.bus.run)
        if self._stop is not None:
            self._stop_gates(self._stop)

    def tick(self, k: int) -> None:
        """Command all motors in tick k: a part follows its present command, or brakes and stands still if it has none.

        Before that, the method checks for a new emergency stop. Then it checks and admits the newest `Commands` message, except in lockstep
        (every tick waits for all participants), in which `admit_waiting` does this.
        """
        self._check_stop()  # before commands, and past an inbox that a flood has filled
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
        """In lockstep, admit or refuse the waiting commands, sorted by part, sender and number.

        Their order of arrival therefore has no effect.
        """
        q = self._backend.motors.q
        for part, order in sorted(self._waiting, key=lambda item: (item[0], item[1].src, item[1].seq)):
            self._admit(part, order, q, self._service.bus.k)
        self._waiting.clear()

    def hold_dependents(self, who: str) -> None:
        """Put all parts that the service `who` owns in hold, because `who` is late: they brake and stand still.

        If `who` is the model, the router or the launcher, all parts are put in hold.
        """
        if who in INDISPENSABLE:
            self.hold_all(f"{who} is late")
        for gate in self.gates.values():
            if gate.owner is not None and gate.owner[0] == who:
                gate.force_hold(f"its owner {who} is late")

    def hold_all(self, why: str) -> None:
        """Put every armed part (part that may move) in hold at once: it brakes and stands still. `why`: reason, for the event."""
        for gate in self.gates.values():
            gate.force_hold(why)

    def _gate(self, part: str, epoch: int) -> Gate:
        def report(code: str, text: str, values: dict[str, float]) -> None:
            self._service.bus.event("warning", code, text, **values)

        ttl_ticks = LOCKED_TTL if self._service.locked else None
        return Gate(part, Limits.of(self._robot, part), self._dt, epoch, report, ttl_ticks, self._speed)

    def _declare(self) -> None:
        service = self._service
        for part in self.gates:
            self._listen(part)
        if service.locked:
            service.on_each(Commands, self._take_commands)
        service.on_request(keys.drive("*", "take"), Take, self._take, part_of_key=True)
        for verb in ("arm", "release", "hold"):
            service.on_request(keys.drive("*", verb), WithEpoch, self._drive, part_of_key=True)
        service.on_request(keys.ESTOP_RESET, Empty, self._reset_stop)
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
        """Admit or refuse an order to a part; `q`: (n,) rad, measured positions of all motors; `k`: the present tick."""
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
            if not self._counted.get(who):
                self._counted[who] = instance
            return
        for gate in self.gates.values():
            if gate.owner == (who, instance):
                gate.lose_owner()
        if who in INDISPENSABLE and instance == self._counted[who]:
            self._counted[who] = next(iter(self._service.alive.get(who, ())), "")
            self.hold_all(f"{who} is gone")

    def _watch_line(self) -> None:
        """Check for emergency stops also while no tick begins: in a pause, and while lockstep waits."""
        self._check_stop()
        self._service.inbox.at(time.monotonic() + CHECK_PERIOD, self._watch_line)

    def _check_stop(self) -> None:
        for message in self._line.take():
            if message.src != self._service.who or message.run not in self._runs:  # not this process's own repetition
                self._obey(Stop(message.source, message.reason, time.time()))
        if self._record is not None and (recorded := self._record.new_stop()) is not None:
            self._obey(recorded)
        if self._datagrams is not None:
            for message in self._datagrams.take():
                self._obey(Stop(message.source, message.reason, time.time()))
            self._datagrams.confirm()

    def _obey(self, stop: Stop) -> None:
        if not replaces(stop, self._stop):
            return
        was_released, self._stop = self._stop is None, stop
        if was_released:
            self._stop_all(stop)
        if self._record is not None and self._record.read() != stop:
            try:
                self._record.latch(stop)
            except OSError as error:
                self._service.bus.event("error", "estop_record", f"the stop holds, but {self._record.path} was not written: {error}")

    def _stop_all(self, stop: Stop) -> None:
        """Put the gates of all parts (the last checks of commands before the motors) into the state estop, and publish the stop.

        In this state a gate brakes its motors and obeys no command. The stop is published periodically until it is reset.
        """
        self._stop_gates(stop)
        self._repetition.cancel()  # of a stop that was reset less than a period ago
        self._repeat_stop()

    def _stop_gates(self, stop: Stop) -> None:
        for gate in self.gates.values():
            gate.stop(str(stop))

    def _repeat_stop(self) -> None:
        if self._stop is not None:
            self._estop.put(set=True, source=self._stop.source, reason=self._stop.reason[:2000])
            self._repetition = self._service.inbox.at(time.monotonic() + ESTOP_PERIOD, self._repeat_stop)

    def _reset_stop(self, request: Empty, key: str) -> Done:
        """Release the robot; if the release cannot be recorded, the stop stays."""
        self._check_stop()
        if self._stop is not None:
            if self._record is not None:
                try:
                    self._record.release()
                except OSError as error:
                    raise CallRefused("estop_record", f"the stop stays: {self._record.path} was not written: {error}") from None
            self._stop = None
            for gate in self.gates.values():
                gate.reset_stop()
            self._service.bus.event("warning", "estop_reset", f"emergency stop reset by {request.who}")
            self._estop.put(set=False, source=request.who, reason="reset")  # for people who watch; no service relies on it
        return Done(v=VERSION)
