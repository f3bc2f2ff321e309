# SPDX-License-Identifier: Apache-2.0
"""Faults as schedules drawn by a seed: processes of a running system are killed and frozen, and messages forged, at given times."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bus_schema import keys
from bus_schema.messages import EStop
from bus_schema.rpc import Driven, Empty, Reply, Stat, Take, Taken, WithEpoch
from services.common import rpc
from services.common.bus import Bus
from tests.system.live import PARTS, Launch, Watcher

VITAL = ("robot_sim", "controller", "model", "launcher")  # the launcher is the router
STOP_AT = 1.0  # s after the beginning of a schedule
FORGED = ("false_stop", "release", "arm")


@dataclass(frozen=True)
class Fault:
    """What happens `at` s after the beginning: a process is killed, or frozen for `duration` s, or a message is forged."""

    at: float
    kind: str  # kill, freeze, stop, or one of FORGED
    who: str = ""
    duration: float = 0.0

    def __str__(self) -> str:
        frozen = f" for {self.duration:.1f} s" if self.duration else ""
        return f"{self.at:.2f} s {self.kind} {self.who}{frozen}".strip()


def draw_stop_schedule(seed: int) -> list[Fault]:
    """An emergency stop among up to five faults; some come before it, so that robot_sim or controller may not hear it at once.

    The launcher, which is the router, fails only after it: without a router nobody hears a stop, which `mobee estop` reports.
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
            who = str(rng.choice(VITAL if at > STOP_AT + 0.05 else VITAL[:-1]))
            faults.append(Fault(at, kind, who, duration))
    return sorted(faults, key=lambda fault: fault.at)


class Culprit:
    """Performs faults on a system."""

    def __init__(self, system: Launch, watcher: Watcher, bus: Bus) -> None:
        self._system, self._watcher = system, watcher
        self._stops = bus.publisher(EStop)
        self._pids = {who: watcher.pid(who) for who in VITAL if who != "launcher"} | {"launcher": system.process.pid}
        self._thaw: list[tuple[float, int]] = []  # monotonic time, process

    def perform(self, schedule: Sequence[Fault]) -> float:
        """Perform all faults at their times; returns the monotonic time at which the stop was published."""
        begun, stopped = time.monotonic(), 0.0
        for fault in schedule:
            self._wait(begun + fault.at)
            if fault.kind == "stop":
                stopped = time.monotonic()
            self._do(fault)
        self._wait(max((at for at, _ in self._thaw), default=0.0))
        return stopped

    def _wait(self, until: float) -> None:
        while True:
            due = min([until, *(at for at, _ in self._thaw)])
            time.sleep(max(0.0, due - time.monotonic()))
            for at, pid in [each for each in self._thaw if each[0] <= time.monotonic()]:
                self._thaw.remove((at, pid))
                _send(pid, signal.SIGCONT)
            if time.monotonic() >= until and not any(at <= until for at, _ in self._thaw):
                return

    def _do(self, fault: Fault) -> None:
        if fault.kind in ("stop", "false_stop"):
            self._stops.put(set=fault.kind == "stop", source="test", reason="a schedule of faults")
        elif fault.kind in FORGED:
            self._forge(fault.kind)
        elif (pid := self._pid(fault.who)) is not None:
            _send(pid, signal.SIGKILL if fault.kind == "kill" else signal.SIGSTOP)
            if fault.kind == "freeze":
                self._thaw.append((time.monotonic() + fault.duration, pid))

    def _pid(self, who: str) -> int | None:
        """The process of a service; None while none answers."""
        if who == "launcher":
            return self._pids[who]
        with contextlib.suppress(rpc.CallFailed, OSError):
            self._pids[who] = rpc.call(self._watcher.session, "culprit", keys.service_rpc(who, "stat"), Empty, Stat, timeout=0.2).pid
            return self._pids[who]
        return None

    def _forge(self, kind: str) -> None:
        """Take a part in the controller's name and arm it, or release it by its public epoch."""
        part, states = PARTS[2], self._watcher.states[PARTS[2]]
        if kind == "release" and states:
            self._call(keys.drive(part, "release"), WithEpoch, Driven, epoch=states[-1].epoch)
        elif kind == "arm" and isinstance(taken := self._call(keys.drive(part, "take"), Take, Taken, instance="i1_forged"), Taken):
            self._call(keys.drive(part, "arm"), WithEpoch, Driven, epoch=taken.epoch)

    def _call(self, key: str, request: Any, reply: type[Reply], **fields: object) -> Reply | None:
        with contextlib.suppress(rpc.CallFailed):
            return rpc.call(self._watcher.session, "controller", key, request, reply, timeout=0.2, **fields)
        return None


def _send(pid: int, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.kill(pid, number)
