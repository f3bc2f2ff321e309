# SPDX-License-Identifier: Apache-2.0
"""A system that runs for hours: memory, open files and threads of its processes, and whether it becomes slower.

Claim: after a warm-up of a tenth of the time no process is started again, the memory of each grows by less than 5 MB, open files and
threads stay the same, and the last tenth of the ticks takes at most 1.2 times as long as the first one after the warm-up.  Three agents
learn on the motor model, in lockstep, where a robot hour takes minutes; or live, with --scenario, in real time.  The recorder runs.
"""

from __future__ import annotations

import os
import tempfile
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bus_schema import decode
from bus_schema.messages import Clock
from bus_schema.rpc import Stat
from experiments.kit.command_line import Progress
from experiments.kit.live.launch import LaunchFailed
from experiments.kit.live.system import running, stat_of, wait_for
from services.common.observe import Received, alive, listen
from services.common.session import open_client

MOST_GROWTH, MOST_SLOWER = 5.0, 1.2  # MB; last tenth over first tenth
WARM = 0.1  # share of the robot's time before the first number counts
SAMPLES = 200  # of the whole run
_SHORTEST = 1.0  # s between two samples
_PATIENCE = 30.0  # s until a process answers
_NUMBERS = ("memory_mb", "files", "threads")


@dataclass(frozen=True, slots=True)
class Settings:
    """The robot's time in hours, and a scenario without monitor: in lockstep, or live."""

    hours: float = 8.0
    scenario: str = "lockstep"


QUICK = Settings(hours=0.2)


def measure(settings: Settings) -> dict[str, Any]:
    """Run the system and read the status of its processes; raises LaunchFailed."""
    clock: list[int] = []

    def note(received: Received) -> None:
        clock[:] = [decode(Clock, received.payload, received.encoding).t]

    end = settings.hours * 3600e9
    rows: list[tuple[float, float, dict[str, Stat]]] = []  # s of this machine, s of the robot, status
    with Progress() as progress, tempfile.TemporaryDirectory() as scratch, running(Path(scratch), settings.scenario) as system:
        with open_client(system.endpoint) as session:
            listen(session, Clock.stream.key(), note)
            names = sorted({*alive(session)} - {"router"})
            wait_for(lambda: bool(clock), _PATIENCE, "the robot's clock")
            begun, first = time.monotonic(), clock[0]
            while True:
                if system.process.poll() is not None:
                    raise LaunchFailed(f"the system has ended after {1e-9 * (clock[0] - first):.0f} s of the robot")
                now, at = time.monotonic(), clock[0]
                rows.append((now - begun, 1e-9 * (at - first), _stats(session, names)))
                progress.show(min(1.0, (at - first) / end), f"{(at - first) / 3600e9:.2f} h of the robot")
                if at - first >= end:
                    break
                time.sleep(_until_next(now - begun, (at - first) / end))
    return _judged(rows, names)


def _until_next(passed: float, share: float) -> float:
    """Return the time until the next sample, so that the whole run has about SAMPLES."""
    return _SHORTEST if share <= 0.0 else float(np.clip(passed / share / SAMPLES, _SHORTEST, 60.0))


def _stats(session: Any, names: list[str]) -> dict[str, Stat]:
    return {who: wait_for(partial(stat_of, session, who, 2.0), _PATIENCE, f"{who} answers") for who in names}


def _judged(rows: list[tuple[float, float, dict[str, Stat]]], names: list[str]) -> dict[str, Any]:
    hours = rows[-1][1] / 3600.0
    kept = [row for row in rows if row[1] >= WARM * rows[-1][1]]
    if len(kept) < 10:
        raise LaunchFailed(f"{len(kept)} samples after the warm-up are too few: run it for more --hours")
    at = np.array([row[1] for row in kept]) / 3600.0
    processes = {who: _process(at, [row[2][who] for row in kept]) for who in names}
    paces = [(after[0] - before[0]) / max(after[1] - before[1], 1e-9) for before, after in zip(kept, kept[1:], strict=False)]
    tenth = max(1, len(paces) // 10)
    slower = float(np.median(paces[-tenth:]) / np.median(paces[:tenth]))
    restarted = [who for who in names if len({row[2][who].pid for row in rows}) > 1]
    steady = all(one["grown_mb"] < MOST_GROWTH and not one["more_files"] and not one["more_threads"] for one in processes.values())
    return {
        "robot_hours": hours,
        "seconds": rows[-1][0],
        "processes": processes,
        "slower": slower,
        "restarted": restarted,
        "load": os.getloadavg()[0],
        "passed": steady and slower <= MOST_SLOWER and not restarted,
    }


def _process(hours: Any, stats: list[Stat]) -> dict[str, float]:
    """Return the memory, its slope per robot hour with its standard error, and the growth of all numbers, of one process."""
    memory, files, threads = (np.array([float(stat.health.get(name) or 0.0) for stat in stats]) for name in _NUMBERS)
    fit, covariance = np.polyfit(hours, memory, 1, cov=True)
    tenth = max(1, len(memory) // 10)
    return {
        "memory_mb": float(memory[-1]),
        "grown_mb": float(np.median(memory[-tenth:]) - np.median(memory[:tenth])),
        "slope_mb_per_hour": float(fit[0]),
        "slope_error": float(np.sqrt(covariance[0, 0])),
        "more_files": float(np.median(files[-tenth:]) - np.median(files[:tenth])),
        "more_threads": float(np.median(threads[-tenth:]) - np.median(threads[:tenth])),
    }


def report(result: dict[str, Any]) -> str:
    """Format the measurements."""
    lines = [f"{result['robot_hours']:.2f} robot hours in {result['seconds'] / 60.0:.1f} minutes; load {result['load']:.1f}"]
    lines.append(f"{'process':<18}{'memory MB':>10}{'grown':>8}{'MB per hour':>18}{'files':>8}{'threads':>9}")
    for who, one in result["processes"].items():
        slope = f"{one['slope_mb_per_hour']:.2f} +- {one['slope_error']:.2f}"
        lines.append(
            f"{who:<18}{one['memory_mb']:>10.1f}{one['grown_mb']:>8.1f}{slope:>18}{one['more_files']:>+8.0f}{one['more_threads']:>+9.0f}"
        )
    lines.append(f"A tick of the last tenth over one of the first: {result['slower']:.2f}.")
    lines.append(f"Processes that were started again: {', '.join(result['restarted']) or 'none'}.")
    return "\n".join(lines)
