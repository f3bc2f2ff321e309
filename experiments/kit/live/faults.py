# SPDX-License-Identifier: Apache-2.0
"""Schedules of faults of a running system.

A schedule is drawn at random from a seed, and performed on the processes of the system.  If the system fails, a shorter schedule with which
it still fails is searched.
"""

from __future__ import annotations

import logging
import os
import resource
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from bus_schema import keys
from bus_schema.messages import EStop
from bus_schema.rpc import Driven, Reply, Request, Take, Taken, WithEpoch
from experiments.kit.live.floods import flood
from experiments.kit.live.system import stat_of
from services.common import rpc
from services.common.bus import Bus

_R = TypeVar("_R", bound=Reply)

FORGED = ("false_stop", "release", "arm")
"""Kinds of faults that are messages or calls in the name of another client, to test that none of them releases an emergency stop."""

FORGED_PART = "left_arm"
"""The part of the robot that forged calls try to take, arm or release."""

KINDS = ("kill", "freeze", "throttle", "disk", "files", "flood", "token", "duplicate")
"""The kinds of faults that `draw` puts into a schedule; `FaultInjector` states what each one does."""
_SHARES = (0.34, 0.24, 0.08, 0.08, 0.06, 0.08, 0.06, 0.06)  # of KINDS
_FREEZES = (0.2, 1.0, 3.0)  # s; a service that is frozen for longer than 2 s is killed by the launcher
_FLOODS = ("estop, set = false", "calls of robot_sim's stat", "tick, garbage", "commands, garbage", "tokens")
VITAL = ("robot_sim", "controller", "model")
STOP_AT = 1.0  # s after the beginning of a schedule around a stop
_SIGNALLED = ("kill", "freeze", "throttle", "disk", "files")  # kinds that need the process of their target
_FILES = 20  # that a process may open while it has too few
_THROTTLE_PERIOD = 0.05  # s


@dataclass(frozen=True)
class Fault:
    """A fault that begins `at` seconds after the beginning of a schedule and lasts for `duration` seconds; 0: it is over at once.

    `kind`: what happens, as `FaultInjector` states.  `target`: name of the service, or of the flood.
    """

    at: float
    kind: str
    target: str = ""
    duration: float = 0.0

    def __str__(self) -> str:
        lasts = f" for {self.duration:.1f} s" if self.duration else ""
        return f"{self.at:.2f} s {self.kind} {self.target}{lasts}".replace("  ", " ").strip()


def draw(seed: int, services: Sequence[str], seconds: float, period: float) -> list[Fault]:
    """Draw a random schedule: faults of the kinds in KINDS on the given services, on average one in each `period` [s], at least one.

    `seed`: of the draw.  `seconds`: all faults begin within this time.
    """
    rng = np.random.default_rng(seed)
    agents = [name for name in services if name.startswith("agent_")]
    faults = []
    for at in np.sort(rng.uniform(0.0, seconds, max(1, rng.poisson(seconds / period)))):
        kind = str(rng.choice(KINDS, p=_SHARES))
        target, duration = str(rng.choice(services)), 0.0
        if kind == "freeze":
            duration = float(rng.choice(_FREEZES))
        elif kind in ("throttle", "token", "duplicate"):
            target, duration = str(rng.choice(VITAL if kind == "duplicate" else services)), 1.5
        elif kind in ("disk", "files"):
            target, duration = str(rng.choice(agents)) if agents else target, 2.0
        elif kind == "flood":
            target, duration = str(rng.choice(_FLOODS)), 1.5
        faults.append(Fault(round(float(at), 3), kind, target, duration))
    return faults


def draw_around_stop(seed: int) -> list[Fault]:
    """Draw a random schedule with an emergency stop after 1 s, and two to five other faults, before or after the stop.

    `seed`: of the draw.  Faults of the launcher, which is also the router, begin only after the stop.  Without a router no process would
    receive the stop; this case is not tested here, because `mobee estop` reports it.
    """
    rng = np.random.default_rng(seed)
    faults = [Fault(STOP_AT, "stop")]
    for _ in range(rng.integers(2, 6)):
        at = float(rng.uniform(0.7, 4.0))
        kind = str(rng.choice(["kill", "kill", "freeze", "forge"]))
        if kind == "forge":
            faults.append(Fault(at, str(rng.choice(FORGED))))
        else:
            duration = float(rng.choice([0.3, 1.0, 3.0])) if kind == "freeze" else 0.0
            faults.append(Fault(at, kind, str(rng.choice((*VITAL, "launcher") if at > STOP_AT + 0.05 else VITAL)), duration))
    return sorted(faults, key=lambda fault: fault.at)


def shrunk(schedule: Sequence[Fault], fails: Callable[[Sequence[Fault]], bool], tries: int) -> list[Fault]:
    """Return a shorter schedule with which the system still fails.

    Halves of the schedule, then smaller pieces, at last single faults are left out, and stay out if the system still fails without them.
    If no shorter schedule is found, the whole schedule is returned.

    `fails`: performs a schedule and returns whether the system fails.  `tries`: largest number of calls of `fails`.
    """
    kept, size = list(schedule), len(schedule) // 2
    while size >= 1 and tries > 0:
        for begin in range(0, len(kept), size):
            shorter = kept[:begin] + kept[begin + size :]
            if not shorter or tries == 0:
                continue
            tries -= 1
            if fails(shorter):
                kept = shorter
                break
        else:
            size //= 2
            continue
        size = min(size, len(kept) // 2)
    return kept


class FaultInjector:
    """Performs faults on the processes of one system.

    Kinds of faults: "kill": the process of a service is killed.  "freeze": it is stopped for a time, by a signal.  "throttle": it is
    stopped and continued in turn, 50 ms each.  "disk": it cannot write a byte to a file.  "files": it cannot open more than 20 files.
    "flood": one of `floods.FLOODS` (many messages, calls, tokens or connections) is sent.  "token": a liveliness token (the mark on the bus
    that a process runs) with the name of a service is declared without a process.  "duplicate": a second process of a service is started.
    "stop": an emergency stop is sent.  The kinds in FORGED test that other clients cannot release an emergency stop.  "false_stop": an
    EStop message with `set = false` is sent.  "release", "arm": a call is sent whose sender pretends to be the controller.
    """

    def __init__(self, session: Any, endpoint: str, launcher: int | None = None, epoch: Callable[[], int | None] = lambda: None) -> None:
        """`session`: of Zenoh.  `endpoint`: address of the router.

        `launcher`: process id of the launcher, needed if schedules name it.  `epoch`: function that returns the drive epoch of the part
        FORGED_PART ("left_arm"), None if it is not known.  The drive epoch is a number that changes with the client that owns (may command)
        the part; a forged release must contain it.
        """
        self._session, self._endpoint, self._launcher, self._epoch = session, endpoint, launcher, epoch
        self._stops = Bus(session, "faults", logging.getLogger("faults")).publisher(EStop)
        self._ends: list[tuple[float, ExitStack]] = []  # monotonic time at which what lasts for a while is over

    def perform(self, schedule: Sequence[Fault]) -> list[float]:
        """Perform all faults at their times, wait until the last one is over, and return the monotonic time [s] at which each began."""
        begun, times = time.monotonic(), []
        try:
            for fault in schedule:
                self._wait(begun + fault.at)
                pid = self._pid(fault.target) if fault.kind in _SIGNALLED else None  # a call: before the time
                times.append(time.monotonic())
                self._do(fault, pid)
            self._wait(max((at for at, _ in self._ends), default=0.0))
        finally:
            for _, lasting in self._ends:
                lasting.close()
            self._ends.clear()
        return times

    def _wait(self, until: float) -> None:
        while True:
            due = min([until, *(at for at, _ in self._ends)])
            time.sleep(max(0.0, due - time.monotonic()))
            for end in [each for each in self._ends if each[0] <= time.monotonic()]:
                self._ends.remove(end)
                end[1].close()
            if time.monotonic() >= until and not any(at <= until for at, _ in self._ends):
                return

    def _do(self, fault: Fault, pid: int | None) -> None:
        if fault.kind in ("stop", "false_stop"):
            self._stops.put(set=fault.kind == "stop", source="test", reason="a schedule of faults")
        elif fault.kind in FORGED:
            self._forge(fault.kind)
        elif fault.kind == "kill":
            if pid is not None:
                _send(pid, signal.SIGKILL)
        else:
            lasting = ExitStack()
            lasting.enter_context(self._lasting(fault, pid))
            self._ends.append((time.monotonic() + fault.duration, lasting))

    def _lasting(self, fault: Fault, pid: int | None) -> AbstractContextManager[None]:
        if fault.kind == "flood":
            return flood(self._endpoint, fault.target)
        if fault.kind == "token":
            return _forged_token(self._session, fault.target)
        if fault.kind == "duplicate":
            return _duplicate(self._endpoint, fault.target)
        if pid is None:
            return nullcontext()
        return {"freeze": _frozen, "throttle": _throttled, "disk": _without_disk, "files": _without_files}[fault.kind](pid)

    def _pid(self, service: str) -> int | None:
        """Return the process of a service; None if it does not answer: then there is nothing to kill or freeze.

        The launcher is also the router: nothing answers while it is frozen.
        """
        if service == "launcher":
            return self._launcher
        stat = stat_of(self._session, service, timeout=0.2)
        return None if stat is None else stat.pid

    def _forge(self, kind: str) -> None:
        """Pretend to be the controller, and call robot_sim to take and arm FORGED_PART ("arm"), or to release it ("release").

        The release needs the epoch, the number of the present ownership of the part, which every program can read on the bus.
        """
        if kind == "release" and (epoch := self._epoch()) is not None:
            self._call(keys.drive(FORGED_PART, "release"), WithEpoch, Driven, epoch=epoch)
        elif kind == "arm" and (taken := self._call(keys.drive(FORGED_PART, "take"), Take, Taken, instance="i1_forged")) is not None:
            self._call(keys.drive(FORGED_PART, "arm"), WithEpoch, Driven, epoch=taken.epoch)

    def _call(self, key: str, request: type[Request], reply: type[_R], **fields: Any) -> _R | None:
        with suppress(rpc.CallFailed):  # refused, as it should be, or robot_sim is down
            return rpc.call(self._session, "controller", key, request, reply, timeout=0.2, **fields)
        return None


@contextmanager
def _forged_token(session: Any, service: str) -> Iterator[None]:
    """Declare a liveliness token with the name of a service, without a process."""
    token = session.liveliness().declare_token(keys.alive(service, "i1_forged"))
    try:
        yield
    finally:
        token.undeclare()


@contextmanager
def _duplicate(endpoint: str, service: str) -> Iterator[None]:
    """Start a second process of a service; it ends by itself when it finds the first."""
    argv = [sys.executable, "-m", "mobee_system.run", f"services.{service}", "--endpoint", endpoint]
    process = subprocess.Popen(argv, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.kill()
        process.wait()


@contextmanager
def _frozen(pid: int) -> Iterator[None]:
    _send(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        _send(pid, signal.SIGCONT)


@contextmanager
def _throttled(pid: int) -> Iterator[None]:
    """Stop and continue a process in turn; at the end it is continued."""
    over = threading.Event()

    def alternate() -> None:
        while not over.is_set():
            for number in (signal.SIGSTOP, signal.SIGCONT):
                _send(pid, number)
                over.wait(_THROTTLE_PERIOD)

    thread = threading.Thread(target=alternate, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@contextmanager
def _without_disk(pid: int) -> Iterator[None]:
    with _limited(pid, resource.RLIMIT_FSIZE, 0):
        yield


@contextmanager
def _without_files(pid: int) -> Iterator[None]:
    with _limited(pid, resource.RLIMIT_NOFILE, _FILES):
        yield


@contextmanager
def _limited(pid: int, limit: int, soft: int) -> Iterator[None]:
    """Set the soft limit of a resource of a process to `soft`, and restore it at the end of the context.

    `limit`: the resource, such as resource.RLIMIT_NOFILE.  If the process has ended before, nothing is done.
    """
    try:
        before = resource.prlimit(pid, limit)
        resource.prlimit(pid, limit, (soft, before[1]))
    except ProcessLookupError:
        yield
        return
    try:
        yield
    finally:
        with suppress(ProcessLookupError):  # it has ended meanwhile
            resource.prlimit(pid, limit, before)


def _send(pid: int, number: int) -> None:
    with suppress(ProcessLookupError):  # it has ended meanwhile
        os.kill(pid, number)
