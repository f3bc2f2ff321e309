# SPDX-License-Identifier: Apache-2.0
"""A bus on which the test plays everybody but the one process under test."""

from __future__ import annotations

import logging
import os
import secrets
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import zenoh

from bus_schema import VERSION, decode, encode, encoding_of, keys
from bus_schema.messages import Message
from bus_schema.rpc import Empty, Failure, Reply, Request, Stat
from experiments.kit.live.launch import free_endpoint
from mobee.robot.robot import Robot
from services.common import rpc
from services.common.bus import Bus
from services.common.service import FRESH_STATS, STATS_PERIOD
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


class Program:
    """A Python process under test and its output."""

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
        self._stat_times: dict[str, deque[float]] = {}  # per service, monotonic clock
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
        wait_for(lambda: not program.is_running or self.instances(who) - before, f"the token of {who}", 60.0)
        assert program.is_running, program.says
        return program

    def spawn(self, *arguments: str) -> Program:
        program = Program(self.folder / f"{secrets.token_hex(4)}.log", arguments)
        self._programs.append(program)
        return program

    # Liveliness

    def instances(self, who: str) -> set[str]:
        return {instance for name, instance in tuple(self.alive) if name == who}  # another thread adds to it

    def token(self, who: str, instance: str) -> None:
        self._tokens[who, instance] = self.session.liveliness().declare_token(keys.alive(who, instance))

    def holds(self, who: str, instance: str) -> bool:
        """Whether the test itself has declared that token and not dropped it; the bus may report a change later."""
        return (who, instance) in self._tokens

    def drop_token(self, who: str, instance: str) -> None:
        self._tokens.pop((who, instance)).undeclare()

    def _note_alive(self, sample: zenoh.Sample) -> None:
        _, who, instance = str(sample.key_expr).split("/")
        (self.alive.add if sample.kind == zenoh.SampleKind.PUT else self.alive.discard)((who, instance))

    # Streams and calls

    def listen(self, key: str, handler: Callable[[zenoh.Sample], None]) -> None:
        self._kept.append(self.session.declare_subscriber(key, self._guarded(handler)))

    def record(self, cls: type[Message], name: str = "*") -> list[Any]:
        """A list that grows with the stream; everything in it has passed the codec."""
        found: list[Any] = []
        size = self.bus.part_sizes.get(name)

        def note(sample: zenoh.Sample) -> None:
            found.append(decode(cls, sample.payload.to_bytes(), str(sample.encoding), part=size, robot=self.bus.robot_size))

        self.listen(cls.stream.keys(name), note)
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

    def call(self, key: str, request: type[Request], reply: type[Any], who: str = "test", timeout: float = 10.0, **fields: Any) -> Any:
        return rpc.call(self.session, who, key, request, reply, timeout=timeout, **fields)

    def stat(self, who: str) -> Stat:
        """Return the status of a service, computed for this call: a service repeats its last one if it is asked too often."""
        times = self._stat_times.setdefault(who, deque([0.0] * FRESH_STATS, FRESH_STATS))
        time.sleep(max(times[0] + 1.1 * STATS_PERIOD - time.monotonic(), 0.0))
        stat = self.call(keys.service_rpc(who, "stat"), Empty, Stat)
        times.append(time.monotonic())
        return stat

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
