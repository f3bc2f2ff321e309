# SPDX-License-Identifier: Apache-2.0
"""Faults of a running system as schedules: drawn by a seed, performed on its processes, and shrunk to what still fails."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from bus_schema import keys
from bus_schema.messages import EStop
from bus_schema.rpc import Driven, Reply, Take, Taken, WithEpoch
from experiments.kit.live.floods import flood
from experiments.kit.live.system import stat_of
from services.common import rpc
from services.common.bus import Bus

FORGED = ("false_stop", "release", "arm")
"""Messages of a client that says what it must not: none may release a stop."""

KINDS = ("kill", "freeze", "stutter", "disk", "files", "flood", "squat", "second")
"""What a schedule may hold, see `Culprit`."""
_SHARES = (0.34, 0.24, 0.08, 0.08, 0.06, 0.08, 0.06, 0.06)  # of KINDS
_FREEZES = (0.2, 1.0, 3.0)  # s; a service that is frozen for longer than 2 s is killed by the launcher
_FLOODS = ("estop, set = false", "calls of robot_sim's stat", "tick, garbage", "commands, garbage", "tokens")
VITAL = ("robot_sim", "controller", "model")
_FILES = 20  # that a process may open while it has too few


@dataclass(frozen=True)
class Fault:
    """What happens to a process `at` s after the beginning of a schedule, for `duration` s if it does not happen at once.

    `who`: the process, or the flood.
    """

    at: float
    kind: str
    who: str = ""
    duration: float = 0.0

    def __str__(self) -> str:
        lasts = f" for {self.duration:.1f} s" if self.duration else ""
        return f"{self.at:.2f} s {self.kind} {self.who}{lasts}".replace("  ", " ").strip()


def draw(seed: int, services: Sequence[str], seconds: float, period: float) -> list[Fault]:
    """Return the schedule of a seed: faults of all KINDS on these services, about one in each `period` s, within `seconds`."""
    rng = np.random.default_rng(seed)
    agents = [who for who in services if who.startswith("agent_")]
    faults = []
    for at in np.sort(rng.uniform(0.0, seconds, max(1, rng.poisson(seconds / period)))):
        kind = str(rng.choice(KINDS, p=_SHARES))
        who, duration = str(rng.choice(services)), 0.0
        if kind == "freeze":
            duration = float(rng.choice(_FREEZES))
        elif kind in ("stutter", "squat", "second"):
            who, duration = str(rng.choice(VITAL if kind == "second" else services)), 1.5
        elif kind in ("disk", "files"):
            who, duration = str(rng.choice(agents)) if agents else who, 2.0
        elif kind == "flood":
            who, duration = str(rng.choice(_FLOODS)), 1.5
        faults.append(Fault(round(float(at), 3), kind, who, duration))
    return faults


def shrunk(schedule: Sequence[Fault], fails: Callable[[Sequence[Fault]], bool], tries: int) -> list[Fault]:
    """Return a shorter schedule that still fails: halves, then single faults are left out, in at most `tries` performances."""
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


class Culprit:
    """Performs faults on the processes of one system.

    kill and freeze send signals; stutter freezes and continues a process every 50 ms; disk lets it write no byte to a file, files lets
    it open no more files; flood is one of `floods.FLOODS`; squat keeps a liveliness token with the name of a service, and second starts
    a second process of it.  stop says an emergency stop, and FORGED says otherwise in the name of the controller.
    """

    def __init__(self, session: Any, endpoint: str, pids: dict[str, int], bus: Bus, epoch: Callable[[str], int | None], part: str) -> None:
        """`pids`: processes at the beginning; `epoch`: the drive epoch of a part in its newest state; `part`: on which FORGED calls act."""
        self._session, self._endpoint, self._pids = session, endpoint, pids
        self._stops, self._epoch, self._part = bus.publisher(EStop), epoch, part
        self._ends: list[tuple[float, ExitStack]] = []  # monotonic time at which what lasts for a while is over

    def perform(self, schedule: Sequence[Fault]) -> list[float]:
        """Perform all faults at their times, wait until the last is over, and return the monotonic time of each."""
        begun, times = time.monotonic(), []
        try:
            for fault in schedule:
                self._wait(begun + fault.at)
                times.append(time.monotonic())
                self._do(fault)
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

    def _do(self, fault: Fault) -> None:
        if fault.kind in ("stop", "false_stop"):
            self._stops.put(set=fault.kind == "stop", source="test", reason="a schedule of faults")
        elif fault.kind in FORGED:
            self._forge(fault.kind)
        elif fault.kind == "kill":
            if (pid := self._pid(fault.who)) is not None:
                _send(pid, signal.SIGKILL)
        else:
            lasting = ExitStack()
            lasting.enter_context(self._lasting(fault))
            self._ends.append((time.monotonic() + fault.duration, lasting))

    def _lasting(self, fault: Fault) -> contextlib.AbstractContextManager[Any]:
        if fault.kind == "flood":
            return flood(self._endpoint, fault.who)
        if fault.kind == "squat":
            return contextlib.closing(_Token(self._session, fault.who))
        if fault.kind == "second":
            return _second(self._endpoint, fault.who)
        pid = self._pid(fault.who)
        if pid is None:
            return contextlib.nullcontext()
        return {"freeze": _frozen, "stutter": _stuttering, "disk": _without_disk, "files": _without_files}[fault.kind](pid)

    def _pid(self, who: str) -> int | None:
        """The process of a service; None while none answers.  The launcher, which is also the router, cannot be asked once it is frozen."""
        if who == "launcher":
            return self._pids[who]
        stat = stat_of(self._session, who, timeout=0.2)
        if stat is not None:
            self._pids[who] = stat.pid
        return None if stat is None else stat.pid

    def _forge(self, kind: str) -> None:
        """Take a part in the controller's name and arm it, or release it by its public epoch."""
        epoch = self._epoch(self._part)
        if kind == "release" and epoch is not None:
            self._call(keys.drive(self._part, "release"), WithEpoch, Driven, epoch=epoch)
        elif kind == "arm" and isinstance(taken := self._call(keys.drive(self._part, "take"), Take, Taken, instance="i1_forged"), Taken):
            self._call(keys.drive(self._part, "arm"), WithEpoch, Driven, epoch=taken.epoch)

    def _call(self, key: str, request: Any, reply: type[Reply], **fields: Any) -> Reply | None:
        with suppress(rpc.CallFailed):
            return rpc.call(self._session, "controller", key, request, reply, timeout=0.2, **fields)
        return None


class _Token:
    """A liveliness token with the name of a service, of no process."""

    def __init__(self, session: Any, who: str) -> None:
        self._token = session.liveliness().declare_token(keys.alive(who, "i1_squatter"))

    def close(self) -> None:
        self._token.undeclare()


@contextmanager
def _second(endpoint: str, who: str) -> Iterator[None]:
    """A second process of a service; it ends by itself when it finds the first."""
    argv = [sys.executable, "-m", "mobee_system.run", f"services.{who}", "--endpoint", endpoint]
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
def _stuttering(pid: int) -> Iterator[None]:
    script = f"import os, time\nwhile True:\n    for s in (19, 18):\n        os.kill({pid}, s)\n        time.sleep(0.05)"
    process = subprocess.Popen([sys.executable, "-c", script], stderr=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.kill()
        process.wait()
        _send(pid, signal.SIGCONT)


@contextmanager
def _without_disk(pid: int) -> Iterator[None]:
    with _limited(pid, "RLIMIT_FSIZE", 0):
        yield


@contextmanager
def _without_files(pid: int) -> Iterator[None]:
    with _limited(pid, "RLIMIT_NOFILE", _FILES):
        yield


@contextmanager
def _limited(pid: int, name: str, soft: int) -> Iterator[None]:
    """Lower a limit of a process; it may have ended."""
    import resource

    kind = getattr(resource, name)
    with suppress(OSError):
        before = resource.prlimit(pid, kind)
        resource.prlimit(pid, kind, (soft, before[1]))
    try:
        yield
    finally:
        with suppress(OSError, UnboundLocalError):
            resource.prlimit(pid, kind, before)


def _send(pid: int, number: int) -> None:
    with suppress(ProcessLookupError):
        os.kill(pid, number)
