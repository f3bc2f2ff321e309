# SPDX-License-Identifier: Apache-2.0
"""A whole system, launched as a user launches it, and a client that watches it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import zenoh

from bus_schema import decode, keys
from bus_schema.messages import Clock, Event, Message, Motion, State
from bus_schema.rpc import Empty, Stat
from experiments.kit.live.launch import free_endpoint
from services.common import rpc
from services.common.identity import Identity, assume
from services.common.session import open_client

PARTS = ("torso", "head", "left_arm", "right_arm")
AGENTS = ("torso", "left_arm", "right_arm")


@dataclass
class Launch:
    """A launcher process."""

    process: subprocess.Popen[str]
    endpoint: str
    runs: Path
    errors: Path

    @property
    def run_dir(self) -> Path:
        return next(self.runs.iterdir())

    def log(self, who: str) -> str:
        path = self.run_dir / "logs" / f"{who}.log"
        return path.read_text() if path.exists() else ""

    def summary(self, timeout: float) -> dict[str, Any]:
        """Wait for the end of a run with a duration; its summary."""
        out, _ = self.process.communicate(timeout=timeout)
        assert self.process.returncode == 0, self.errors.read_text()[-3000:]
        return dict(json.loads(out))


def launch(
    folder: Path,
    scenario: str,
    *settings: str,
    headless: bool = True,
    duration: float | None = None,
    ticks: int | None = None,
    endpoint: str | None = None,
    record: bool = False,
    keys: Path | None = None,
) -> Launch:
    endpoint, runs, errors = endpoint or free_endpoint(), folder / "runs", folder / "launcher.err"
    argv = [sys.executable, "-m", "mobee_cli", "launch", scenario, "--endpoint", endpoint, "--runs", str(runs), "--json"]
    argv += ["--headless"] if headless else []
    argv += [] if record else ["--no-record"]
    argv += ["--duration", str(duration)] if duration else []
    argv += ["--ticks", str(ticks)] if ticks else []
    argv += ["--secure", "--keys", str(keys)] if keys else []
    for setting in settings:
        argv += ["--set", setting]
    with errors.open("w") as sink:
        process = subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=sink, text=True, process_group=0)
    return Launch(process, endpoint, runs, errors)


@contextmanager
def running(
    folder: Path, scenario: str, *settings: str, headless: bool = True, keys: Path | None = None
) -> Iterator[tuple[Launch, Watcher]]:
    """A system that is ready, and a client that watches it, of a secured one as operator; stopped as by Ctrl-C afterwards."""
    system = launch(folder, scenario, *settings, headless=headless, keys=keys)
    try:
        until(lambda: "all ready" in system.errors.read_text() or system.process.poll() is not None, 120.0, "the system is ready")
        assert system.process.poll() is None, system.errors.read_text()[-3000:]
        with acting_as(keys and Identity(keys, "operator")), Watcher(system.endpoint) as watcher:
            until(lambda: watcher.clock, 20.0, "the watcher gets the clock")
            yield system, watcher
    finally:
        if system.process.poll() is None:
            system.process.send_signal(signal.SIGINT)
        try:
            system.process.communicate(timeout=20.0)
        except subprocess.TimeoutExpired:
            os.killpg(system.process.pid, signal.SIGKILL)
            raise


@contextmanager
def acting_as(identity: Identity | None) -> Iterator[None]:
    """Sessions that are opened in the `with` block have the identity."""
    before = Identity.of_environment()
    assume(identity)
    try:
        yield
    finally:
        assume(before)


def until(condition: Callable[[], Any], timeout: float, what: str) -> Any:
    """The condition's first true value; fails with `what` after the timeout."""
    give_up = time.monotonic() + timeout
    while time.monotonic() < give_up:
        value = condition()
        if value:
            return value
        time.sleep(0.01)
    raise AssertionError(f"not within {timeout:g} s: {what}")


@dataclass
class Watcher:
    """Subscribes to clock, states, motions and events, with the tick at which each came."""

    endpoint: str
    clock: Clock | None = None
    states: dict[str, list[State]] = field(default_factory=lambda: {part: [] for part in PARTS})
    motions: dict[str, list[Motion]] = field(default_factory=lambda: {part: [] for part in PARTS})
    events: list[Event] = field(default_factory=list)

    def __enter__(self) -> Watcher:
        self.session = open_client(self.endpoint)
        self._subscriptions = [self.session.declare_subscriber(Clock.stream.key(), self._note_clock)]
        for part in PARTS:
            self._subscribe(State.stream.key(part), State, self.states[part])
            self._subscribe(Motion.stream.key(part), Motion, self.motions[part])
        self._subscribe(Event.stream.keys(), Event, self.events)
        return self

    def __exit__(self, *_: object) -> None:
        self.session.close()

    def close_streams(self) -> None:
        """End the subscriptions; calls can still be made."""
        for subscription in self._subscriptions:
            subscription.undeclare()

    def _subscribe(self, key: str, cls: type[Message], into: list[Any]) -> None:
        def note(sample: zenoh.Sample) -> None:
            into.append(decode(cls, sample.payload.to_bytes(), str(sample.encoding)))

        self._subscriptions.append(self.session.declare_subscriber(key, note))

    def _note_clock(self, sample: zenoh.Sample) -> None:
        self.clock = decode(Clock, sample.payload.to_bytes(), str(sample.encoding))

    @property
    def k(self) -> int:
        return -1 if self.clock is None else self.clock.k

    @property
    def run(self) -> str:
        return "" if self.clock is None else self.clock.run

    def wait_until_it_keeps_up(self) -> None:
        """Ticks come at their pace: after a stall of this process they come in a burst, and the newest one is seconds old."""

        def keeps_up() -> bool:
            before = self.k
            time.sleep(0.1)
            return 5 <= self.k - before <= 20

        until(keeps_up, 20.0, "the watcher gets ticks as they are made")

    def stat(self, who: str) -> Stat:
        return rpc.call(self.session, "watcher", keys.service_rpc(who, "stat"), Empty, Stat, timeout=5.0)

    def pid(self, who: str) -> int:
        """The process of a service; asked more than once, because a stall of this machine may end the session for a moment."""

        def answered() -> int | None:
            try:
                return self.stat(who).pid
            except rpc.CallFailed:
                return None

        return int(until(answered, 15.0, f"{who} answers"))

    def speed(self, part: str) -> float:
        """Fastest motor of the part now, rad/s."""
        seen = self.states[part]
        return max((abs(v) for v in seen[-1].dq), default=0.0) if seen else 0.0

    def rests(self, part: str) -> bool:
        """Whether all motors of the part are slower than 0.02 rad/s: means of a quarter of a second, since one tick is mostly noise."""
        recent = np.array([state.q for state in self.states[part][-50:]])
        return len(recent) == 50 and bool(np.abs(recent[25:].mean(axis=0) - recent[:25].mean(axis=0)).max() < 0.02 * 0.25)

    def wait_moving(self, parts: tuple[str, ...], faster: float = 0.1, timeout: float = 40.0) -> None:
        until(lambda: all(self.speed(part) > faster for part in parts), timeout, f"{', '.join(parts)} move")

    def wait_until_moved(self, parts: tuple[str, ...], faster: float = 0.1, timeout: float = 60.0) -> None:
        """Wait until each part has moved since the call, not necessarily at the same time."""
        until(lambda: self.clock, timeout, "the watcher gets the clock")
        run, k = self.run, self.k

        def moved(part: str) -> bool:
            return any(s.run == run and s.k > k and max(map(abs, s.dq)) > faster for s in self.states[part][-1000:])

        until(lambda: all(moved(part) for part in parts), timeout, f"{', '.join(parts)} have moved")


def transitions(run_dir: Path) -> dict[str, list[tuple[Any, ...]]]:
    """All transitions on disk, by agent."""
    import sqlite3

    with sqlite3.connect(f"file:{run_dir}/transitions.sqlite?mode=ro", uri=True) as database:
        rows = database.execute("SELECT agent, n, s, a, s_next, reward, settled, duration FROM transitions ORDER BY agent, n").fetchall()
    found: dict[str, list[tuple[Any, ...]]] = {agent: [] for agent in AGENTS}
    for agent, *row in rows:
        found[agent].append(tuple(row))
    return found
