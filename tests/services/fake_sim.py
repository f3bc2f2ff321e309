# SPDX-License-Identifier: Apache-2.0
"""robot_sim as a test plays it."""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import zenoh

from bus_schema import VERSION, decode, keys
from bus_schema.messages import Answer, Clock, Command, Commands, PartStatus, Tick
from bus_schema.rpc import Driven, Take, Taken, WithEpoch
from mobee.arrays import Array
from tests.services.harness import Refusal, Rig, wait_for


@dataclass
class FakeGate:
    state: str = "idle"
    epoch: int = 0
    owner: str = ""
    velocity: Array = field(default_factory=lambda: np.zeros(0))
    seq: int = -1
    age: int = -1


class FakeSim:
    """robot_sim without physics: clock, states, drive calls, integrated velocity commands; ticks when the test says so.

    The states of a tick go out before the next tick's clock, all sampled in the middle of the tick, like real ones.
    """

    def __init__(self, rig: Rig, dt: float = 0.01) -> None:
        self.rig, self.robot, self.dt_ns = rig, rig.robot, round(dt * 1e9)
        self.q = rig.robot.home.copy()
        self.frozen = False  # the motors do not follow
        self.silent: set[str] = set()  # parts that send no state
        self.refuses_to_arm: set[str] = set()
        self.takes: list[str] = []  # the part of each call `take`
        self.answers = threading.Event()  # cleared: drive calls are heard and not answered
        self.answers.set()
        self.gates = {part: FakeGate(velocity=np.zeros(len(p)), epoch=100) for part, p in rig.robot.parts.items()}
        self.commands: dict[str, list[Command]] = {part: [] for part in rig.robot.parts}
        self._lock = threading.Lock()
        self.answers_along: list[tuple[int, Answer]] = []  # lockstep: ticks that were answered with the commands
        self.before_tick: Callable[[int], None] = lambda k: None  # messages of others before tick k is published, free mode
        self._measured = self.q.copy()
        self.statuses: dict[str, PartStatus] = {}
        self._tick = rig.bus.publisher(Tick)
        self._clock = rig.bus.publisher(Clock)
        rig.listen(Commands.stream.key(), self._obey)
        rig.serve(keys.drive("*", "take"), Take, self._take)
        rig.serve(keys.drive("*", "arm"), WithEpoch, self._arm)
        self.new_run()

    def new_run(self) -> None:
        """Act as after a restart: at home, no part has an owner, k from 0."""
        bus = self.rig.bus
        bus.run, bus.k, bus.t = f"run_{secrets.token_hex(3)}", 0, 0
        self.q = self.robot.home.copy()
        self.statuses = {}
        for gate in self.gates.values():
            gate.state, gate.owner, gate.velocity = "idle", "", 0.0 * gate.velocity

    def tick(self, skip: int = 0, mode: str = "free", dt_ns: int | None = None) -> int:
        """Samples at the end of a tick, then the start of the next; `skip`: ticks before it that are not published."""
        bus = self.rig.bus
        bus.k += skip
        bus.t += skip * self.dt_ns
        self.sample()
        bus.k += 1
        bus.t += self.dt_ns
        self._move()
        self.begin(mode, dt_ns)
        return bus.k

    def begin(self, mode: str = "free", dt_ns: int | None = None, whole: bool = True) -> None:
        """Begin the tick; it is published only if every part was sampled, unless it need not have the `whole` body."""
        if mode == "free":
            self.before_tick(self.rig.bus.k)
        if len(self.statuses) == len(self.gates) or not whole:
            self._tick.put(dt=dt_ns or self.dt_ns, mode=mode, rate=1.0, q=self._measured.tolist(), parts=self.statuses)
        self._clock.put(dt=dt_ns or self.dt_ns, mode=mode, rate=1.0)

    def play(self, until: Callable[[], Any], what: str, answered: Callable[[int], Any], ticks: int = 3000) -> Any:
        """Tick until the condition holds; the next tick comes when the last is answered, or a quarter of a second later."""
        for _ in range(ticks):
            if found := until():
                return found
            k = self.tick()
            give_up = time.monotonic() + 0.25
            while not answered(k) and time.monotonic() < give_up:
                time.sleep(0.0002)
        return wait_for(until, f"{what}, after {ticks} ticks")  # messages about the last tick may arrive later

    def hold(self, part: str) -> None:
        """As the gate does when something is wrong."""
        with self._lock:
            self.gates[part].state = "hold"
            self.gates[part].velocity[:] = 0.0

    def of(self, part: str) -> Array:
        return self.q[self.robot.part(part).slice]

    def sample(self) -> None:
        """Every part is read, but those that are silent."""
        bus = self.rig.bus
        for part, gate in self.gates.items():
            if part in self.silent:
                continue
            where = self.robot.part(part).slice
            self._measured[where] = self.q[where]
            mode = "velocity" if gate.state == "armed" else "hold"
            self.statuses[part] = PartStatus(bus.k, bus.t + self.dt_ns // 2, mode, gate.state, 0, gate.epoch, gate.seq, gate.age)

    def _move(self) -> None:
        with self._lock:
            for part, gate in self.gates.items():
                if gate.state == "armed" and not self.frozen:
                    where = self.robot.part(part).slice
                    limits = self.robot.limits[where]
                    self.q[where] = np.clip(self.q[where] + gate.velocity * self.dt_ns * 1e-9, limits[:, 0], limits[:, 1])

    def _obey(self, sample: zenoh.Sample) -> None:
        whole = decode(Commands, sample.payload.to_bytes(), str(sample.encoding), robot=self.rig.bus.robot_size)
        with self._lock:
            for part, order in whole.parts.items():
                header = {name: getattr(whole, name) for name in ("v", "run", "src", "seq", "k", "t", "tw", "re_k", "ttl")}
                ref = whole.ref[self.robot.part(part).slice]
                self._obey_one(part, Command(**header, epoch=order.epoch, mode=order.mode, ref=ref))
            if whole.answer is not None:
                self.answers_along.append((whole.re_k, whole.answer))

    def _obey_one(self, part: str, command: Command) -> None:
        self.commands[part].append(command)
        gate = self.gates[part]
        if gate.state == "armed" and command.epoch == gate.epoch and command.run == self.rig.bus.run:
            gate.velocity = np.array(command.ref) if command.mode == "velocity" else 0.0 * gate.velocity
            gate.seq, gate.age = command.seq, self.rig.bus.k - command.re_k

    def _take(self, request: Take, key: str) -> Taken:
        part = key.split("/")[0]
        self.takes.append(part)
        self.answers.wait()
        with self._lock:
            gate = self.gates[part]
            gate.epoch, gate.owner, gate.state = gate.epoch + 1, request.instance, "hold"
            return Taken(v=VERSION, epoch=gate.epoch)

    def _arm(self, request: WithEpoch, key: str) -> Driven:
        part = key.split("/")[0]
        with self._lock:
            gate = self.gates[part]
            if part in self.refuses_to_arm or request.epoch != gate.epoch:
                raise Refusal("epoch")
            gate.state, gate.velocity = "armed", 0.0 * gate.velocity
            return Driven(v=VERSION, gate="armed")
