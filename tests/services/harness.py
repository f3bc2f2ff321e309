"""A bus on which the test plays everybody but the one process under test."""

from __future__ import annotations

import logging
import os
import secrets
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import zenoh

from bus_schema import VERSION, Refused, decode, encode, encoding_of, keys
from bus_schema.chain import Answer, Commands, PartStatus, Tick
from bus_schema.messages import Clock, Command, Forces, Message, Motion
from bus_schema.rpc import Driven, Empty, Failure, Goal, Reply, Request, Started, Stat, Take, Taken, WithEpoch
from mobee.robot.robot import Array, Robot
from services.common import rpc
from services.common.bus import Bus
from services.common.delivery import LATEST
from services.common.session import open_router

ROOT = Path(__file__).parents[2]
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
QUICK_END = 5.0  # s: generous, the printed time says more


def wait_for(condition: Callable[[], Any], what: str, timeout: float = 10.0) -> Any:
    """The first true answer."""
    give_up = time.monotonic() + timeout
    while not (answer := condition()):
        if time.monotonic() > give_up:
            raise AssertionError(f"waited {timeout:g} s in vain for {what}")
        time.sleep(0.001)
    return answer


def free_endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


class Program:
    """A Python process under test and what it says."""

    def __init__(self, log: Path, arguments: Sequence[str]) -> None:
        self.log = log
        with log.open("ab") as out:
            self.process = subprocess.Popen(
                [sys.executable, *arguments], cwd=ROOT, env={**os.environ, **ONE_THREAD}, stdout=out, stderr=subprocess.STDOUT
            )

    @property
    def says(self) -> str:
        return self.log.read_text(errors="replace")

    @property
    def is_running(self) -> bool:
        return self.process.poll() is None

    def wait(self, timeout: float = QUICK_END) -> int:
        try:
            return self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise AssertionError(f"still running after {timeout:g} s:\n{self.says}") from None

    def stop(self, number: int = signal.SIGTERM) -> int:
        """Send a signal; the exit code."""
        if self.is_running:
            self.process.send_signal(number)
        return self.wait()


class Rig:
    """Router with its token, the processes started on it, and the test's own bus."""

    def __init__(self, folder: Path, robot: Robot) -> None:
        self.folder, self.robot, self.endpoint = folder, robot, free_endpoint()
        self.session = open_router(self.endpoint)
        self.bus = Bus(self.session, "test", logging.getLogger("rig"))
        self.bus.run = "r0"
        self.bus.robot_size = len(robot.motors)
        self.bus.part_sizes = {name: len(part) for name, part in robot.parts.items()}
        self.alive: set[tuple[str, str]] = set()
        self.faults: list[str] = []  # what went wrong in callbacks
        self._kept: list[Any] = []
        self._programs: list[Program] = []
        self._tokens: dict[tuple[str, str], Any] = {}
        liveliness = self.session.liveliness()
        self._kept.append(liveliness.declare_subscriber(keys.ALL_ALIVE, self._note_alive, history=True))
        self.token("router", "rig")

    def close(self) -> None:
        for program in self._programs:
            program.stop(signal.SIGKILL)
        self.session.close()
        assert not self.faults, self.faults

    # Processes

    def start(self, module: str, who: str, *arguments: str) -> Program:
        """`python -m module`, once its token is there."""
        return self.run(who, "-m", module, *arguments, "--endpoint", self.endpoint)

    def run(self, who: str, *arguments: str) -> Program:
        """`python ...`, once the token of `who` is there."""
        before = self.instances(who)
        program = self.spawn(*arguments)
        wait_for(lambda: not program.is_running or self.instances(who) - before, f"the token of {who}", 20.0)
        assert program.is_running, program.says
        return program

    def spawn(self, *arguments: str) -> Program:
        program = Program(self.folder / f"{secrets.token_hex(4)}.log", arguments)
        self._programs.append(program)
        return program

    # Liveliness

    def instances(self, who: str) -> set[str]:
        return {instance for name, instance in self.alive if name == who}

    def token(self, who: str, instance: str) -> None:
        self._tokens[who, instance] = self.session.liveliness().declare_token(keys.alive(who, instance))

    def drop_token(self, who: str, instance: str) -> None:
        self._tokens.pop((who, instance)).undeclare()

    def _note_alive(self, sample: zenoh.Sample) -> None:
        _, who, instance = str(sample.key_expr).split("/")
        (self.alive.add if sample.kind == zenoh.SampleKind.PUT else self.alive.discard)((who, instance))

    # Streams and calls

    def listen(self, key: str, handler: Callable[[zenoh.Sample], None]) -> None:
        self._kept.append(self.session.declare_subscriber(key, self._guarded(handler)))

    def record(self, key: str, cls: type[Message], part: str | None = None) -> list[Any]:
        """A list that grows with the stream; everything in it has passed the codec."""
        found: list[Any] = []
        size = None if part is None else self.bus.part_sizes[part]

        def note(sample: zenoh.Sample) -> None:
            found.append(decode(cls, sample.payload.to_bytes(), str(sample.encoding), part=size, robot=self.bus.robot_size))

        self.listen(key, note)
        return found

    def serve(self, key: str, cls: type[Request], handler: Callable[[Any, str], Reply]) -> None:
        """Answer calls at once, on a thread of Zenoh; a Refusal becomes a Failure."""

        def answer(query: zenoh.Query) -> None:
            name = str(query.key_expr)
            with query:
                try:
                    assert query.payload is not None
                    reply = handler(decode(cls, query.payload.to_bytes(), str(query.encoding)), name)
                except Refusal as refusal:
                    failure = Failure(v=VERSION, code=refusal.code, text=f"no: {refusal.code}")
                    query.reply_err(encode(failure), encoding=encoding_of(Failure))
                    return
                query.reply(name, encode(reply), encoding=encoding_of(type(reply)))

        self._kept.append(self.session.declare_queryable(key, self._guarded(answer)))

    def call(self, key: str, request: type[Request], reply: type[Any], who: str = "test", timeout: float = 2.0, **fields: Any) -> Any:
        return rpc.call(self.session, who, key, request, reply, timeout=timeout, **fields)

    def stat(self, who: str) -> Stat:
        return self.call(keys.service_rpc(who, "stat"), Empty, Stat)

    def _guarded(self, handler: Callable[[Any], None]) -> Callable[[Any], None]:
        def run(thing: Any) -> None:
            try:
                handler(thing)
            except Exception as error:  # Zenoh would print and swallow it
                self.faults.append(repr(error))

        return run


@contextmanager
def rig(folder: Path, robot: Robot) -> Iterator[Rig]:
    made = Rig(folder, robot)
    try:
        yield made
    finally:
        made.close()


class Refusal(Exception):
    """Raised by a fake to refuse a call."""

    def __init__(self, code: str) -> None:
        super().__init__(code)
        self.code = code


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
        self.takes: list[str] = []
        self.answers = threading.Event()  # cleared: drive calls are heard and not answered
        self.answers.set()
        self.gates = {part: FakeGate(velocity=np.zeros(len(p)), epoch=100) for part, p in rig.robot.parts.items()}
        self.commands: dict[str, list[Command]] = {part: [] for part in rig.robot.parts}
        self._lock = threading.Lock()
        self.answers_along: list[tuple[int, Answer]] = []  # lockstep: ticks that were answered with the commands
        self._measured = self.q.copy()
        self.statuses: dict[str, PartStatus] = {}
        self._tick = rig.bus.publisher(keys.TICK, Tick, LATEST)
        self._clock = rig.bus.publisher(keys.CLOCK, Clock, LATEST)
        rig.listen(keys.COMMANDS, self._obey)
        rig.serve(keys.drive("*", "take"), Take, self._take)
        rig.serve(keys.drive("*", "arm"), WithEpoch, self._arm)
        self.new_run()

    def new_run(self) -> None:
        """As after a restart: home, nobody owns anything, k from 0."""
        bus = self.rig.bus
        bus.run, bus.k, bus.t = f"run_{secrets.token_hex(3)}", 0, 0
        self.q = self.robot.home.copy()
        self.statuses = {}
        for gate in self.gates.values():
            gate.state, gate.owner, gate.velocity = "idle", "", 0.0 * gate.velocity

    def tick(self, skip: int = 0, mode: str = "free", dt_ns: int | None = None) -> int:
        """Samples at the end of a tick, then the start of the next; `skip`: ticks of which nobody hears before."""
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
        """The tick begins; nobody hears of it before every part was sampled, unless it need not be the `whole` body."""
        if len(self.statuses) == len(self.gates) or not whole:
            self._tick.put(dt=dt_ns or self.dt_ns, mode=mode, rate=1.0, q=self._measured.tolist(), parts=self.statuses)
        self._clock.put(dt=dt_ns or self.dt_ns, mode=mode, rate=1.0)

    def play(self, until: Callable[[], Any], what: str, answered: Callable[[int], Any], ticks: int = 3000) -> Any:
        """Tick until the condition holds; the next tick comes when the last is answered, or 50 ms later."""
        for _ in range(ticks):
            if found := until():
                return found
            k = self.tick()
            give_up = time.monotonic() + 0.05
            while not answered(k) and time.monotonic() < give_up:
                time.sleep(0.0002)
        raise AssertionError(f"played {ticks} ticks in vain for {what}")

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
        self.answers.wait()
        with self._lock:
            gate = self.gates[part]
            gate.epoch, gate.owner, gate.state = gate.epoch + 1, request.instance, "hold"
            self.takes.append(part)
            return Taken(v=VERSION, epoch=gate.epoch)

    def _arm(self, request: WithEpoch, key: str) -> Driven:
        part = key.split("/")[0]
        with self._lock:
            gate = self.gates[part]
            if part in self.refuses_to_arm or request.epoch != gate.epoch:
                raise Refusal("epoch")
            gate.state, gate.velocity = "armed", 0.0 * gate.velocity
            return Driven(v=VERSION, gate="armed")


class FakeModel:
    """Answers every tick with forces that the test chooses; unless silent, late or muddled."""

    def __init__(self, rig: Rig) -> None:
        n = len(rig.robot.motors)
        self.rig, self.collision = rig, np.zeros(n)
        self.silent, self.behind = False, 0  # ticks by which re_k lags
        self.touched: dict[str, list[str]] = {}
        self.part_age = dict.fromkeys(rig.robot.parts, 0)  # ns
        self._forces = rig.bus.publisher(keys.MODEL_FORCES, Forces, LATEST)
        rig.listen(keys.TICK, self._answer)

    def _answer(self, sample: zenoh.Sample) -> None:
        try:
            tick = decode(Tick, sample.payload.to_bytes(), str(sample.encoding))
        except Refused:  # a test of random bytes
            return
        if not self.silent:
            self.put(max(tick.k - self.behind, 0))

    def put(self, re_k: int) -> None:
        zeros = [0.0] * len(self.collision)
        collision, age = self.collision.tolist(), self.part_age
        self._forces.put(re_k=re_k, limits=zeros, constraints=zeros, collision=collision, part_age=age, touched=self.touched)


class FakeController:
    """The controller of one part, ticking by itself: a goal is reached after some ticks, as `ending` says."""

    def __init__(self, rig: Rig, part: str, period: float = 0.002) -> None:
        self.rig, self.part, self.period = rig, part, period
        self.instance = "c0"
        self.ending = "settled"
        self.lasts = 5  # ticks an action takes
        self.miss = 0.0  # rad by which every motor misses its goal
        self.touched: list[str] = []
        self.goals: list[Goal] = []
        self.loses_answers = 0  # how many answers to goals get lost on the way
        self.on_goal: Callable[[Goal], None] = lambda goal: None
        self.takes = 0
        limits = rig.robot.limits[rig.robot.part(part).slice]
        self.q = limits.mean(axis=1)
        self.epoch, self.owner = 1000, ""
        self.status, self.action_id, self.since_k, self.start_k = "idle", "", 0, 0
        self._target = self.q
        self._started: dict[str, Started] = {}  # by request
        self._lock = threading.RLock()
        self._clock = rig.bus.publisher(keys.CLOCK, Clock, LATEST)
        self._motion = rig.bus.publisher(keys.motion(part), Motion, LATEST)
        rig.serve(keys.goal("*", "take"), Take, self._take)
        rig.serve(keys.goal("*", "goal"), Goal, self._goal)
        rig.token("controller", self.instance)
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def close(self) -> None:
        self._ends.set()
        self._thread.join()

    def new_run(self) -> None:
        with self._lock:
            bus = self.rig.bus
            bus.run, bus.k, bus.t = f"run_{secrets.token_hex(3)}", 0, 0
            self._become("held")
            self.resume()

    def restart(self) -> None:
        """As a controller that died and came back: another instance, nobody owns anything."""
        self.rig.drop_token("controller", self.instance)
        with self._lock:
            self.instance = f"c{self.epoch}"
            self.epoch, self.owner = self.epoch + 1000, ""
            self.resume()
        self.rig.token("controller", self.instance)

    def hold(self) -> None:
        with self._lock:
            self._become("held")

    def resume(self) -> None:
        with self._lock:
            self.action_id = ""
            self._become("idle")

    def _run(self) -> None:
        while not self._ends.wait(self.period):
            with self._lock:
                self._tick()

    def _tick(self) -> None:
        bus = self.rig.bus
        bus.k += 1
        bus.t += 10_000_000
        self._clock.put(dt=10_000_000, mode="free", rate=1.0)
        if self.status == "moving" and bus.k - self.start_k >= self.lasts:
            self.q = self._target + self.miss
            self._become(self.ending)
        zeros = [0.0] * len(self.q)
        self._motion.put(
            action_id=self.action_id,
            epoch=self.epoch if self.owner else 0,
            status=self.status,
            since_k=self.since_k,
            start_k=self.start_k,
            q=self.q.tolist(),
            dq=zeros,
            ddq=zeros,
            goal=self._target.tolist(),
            touched=self.touched,
        )

    def _become(self, status: str) -> None:
        self.status, self.since_k = status, self.rig.bus.k

    def _take(self, request: Take, key: str) -> Taken:
        with self._lock:
            if self.owner not in ("", request.instance) and (request.who, self.owner) in self.rig.alive:
                raise Refusal("owned")
            self.owner, self.epoch, self.takes = request.instance, self.epoch + 1, self.takes + 1
            return Taken(v=VERSION, epoch=self.epoch)

    def _goal(self, request: Goal, key: str) -> Started:
        with self._lock:
            if request.epoch != self.epoch:
                raise Refusal("epoch")
            if self.status == "held":
                raise Refusal("held")
            if request.id not in self._started:
                self._start(request)
            if self.loses_answers:
                self.loses_answers -= 1
                raise Refusal("no_answer")
            return self._started[request.id]

    def _start(self, request: Goal) -> None:
        self.goals.append(request)
        self.on_goal(request)
        self.action_id, self._target, self.start_k = request.action_id, np.array(request.q), self.rig.bus.k
        self._become("moving")
        self._started[request.id] = Started(v=VERSION, k=self.rig.bus.k)
