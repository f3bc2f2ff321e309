# SPDX-License-Identifier: Apache-2.0
"""A system that runs for hours: memory, open files and threads of its processes, and whether it becomes slower.

Claim: after a warm-up of a tenth of the time no process is started again, the memory of each grows by less than 5 MB, open files and
threads stay the same, and the last tenth of the ticks takes at most 1.2 times as long as the first one after the warm-up.  The age of a
command is the number of ticks since the tick that it answers.  The ages of the commands that the motors obey have the same distribution in
both tenths: the distribution functions differ by at most .05.  Three agents learn on the motor model in lockstep: an hour of the robot
takes minutes, and a command always answers the tick before.  With --scenario they can also run live, in real time.  The recorder (the
process that stores the messages of a run) runs, too.
"""

from __future__ import annotations

import os
import tempfile
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bus_schema import decode
from bus_schema.messages import Tick
from bus_schema.rpc import Stat
from experiments.kit.command_line import Progress
from experiments.kit.live.launch import LaunchFailed
from experiments.kit.live.system import running, stat_of, wait_for
from services.common.observe import Received, alive, listen
from services.common.session import open_client

MOST_GROWTH, MOST_SLOWER, MOST_APART = 5.0, 1.2, 0.05  # MB; last tenth over first tenth; of two shares
WARM = 0.1  # share of the robot's time before the first number counts
SAMPLES = 200  # of the whole run
_SHORTEST = 1.0  # s between two samples
_PATIENCE = 30.0  # s until a process answers
_NUMBERS = ("memory_mb", "files", "threads")


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.

    `hours`: simulated time of the robot [h].  `scenario`: name of the scenario; its web page (monitor) is not started.
    """

    hours: float = 8.0
    scenario: str = "lockstep"


QUICK = Settings(hours=0.2)


@dataclass(slots=True)
class _Ticks:
    """The robot's time, and how often the motors of a part obeyed a command of each age."""

    now: int = -1  # ns
    ages: Counter[int] = field(default_factory=Counter)  # ticks
    lock: threading.Lock = field(default_factory=threading.Lock)

    def note(self, received: Received) -> None:
        tick = decode(Tick, received.payload, received.encoding)
        with self.lock:
            self.now = tick.t
            self.ages.update(part.cmd_age for part in tick.parts.values() if part.mode != "hold")

    def take_ages(self) -> Counter[int]:
        """Return how often each age [ticks] of a command occurred since the last call."""
        with self.lock:
            taken, self.ages = self.ages, Counter()
        return taken


@dataclass(frozen=True, slots=True)
class _Sample:
    passed: float  # s of this machine
    at: float  # s of the robot
    stats: dict[str, Stat]
    ages: Counter[int]  # since the sample before


def measure(settings: Settings) -> dict[str, Any]:
    """Run the system, read the status of its processes regularly, and return the result.

    Raises LaunchFailed if the system fails, or if the run is too short to be judged.

    Main keys: "processes", a dict from a process to a dict with "grown_mb", the growth of memory [MB], "more_files" and "more_threads", the
    additional open files and threads; "slower", wall time per second of the robot in the last tenth of the run, divided by that in the
    first tenth after the warm-up; "ages", statistics of the ages of commands (ticks since the tick that a command answers) in these tenths,
    under "first" and "last"; "apart", the statistic of Kolmogorov and Smirnov: the largest difference between the distribution functions of
    the ages in both tenths, 0 to 1; "restarted", list of the processes that were started again; "passed", whether growth, slowdown and
    "apart" are within their limits, and no process was restarted.
    """
    ticks, end, samples = _Ticks(), settings.hours * 3600.0, list[_Sample]()
    with Progress() as progress, tempfile.TemporaryDirectory() as scratch, running(Path(scratch), settings.scenario) as system:
        with open_client(system.endpoint) as session:
            listen(session, Tick.stream.key(), ticks.note)
            names = sorted({*alive(session)} - {"router"})
            wait_for(lambda: ticks.now >= 0, _PATIENCE, "the robot's clock")
            begun, first = time.monotonic(), ticks.now
            while True:
                passed, at = time.monotonic() - begun, 1e-9 * (ticks.now - first)
                if system.process.poll() is not None:
                    raise LaunchFailed(f"the system has ended after {at:.0f} s of the robot")
                samples.append(_Sample(passed, at, _stats(session, names), ticks.take_ages()))
                progress.show(min(1.0, at / end), f"{at / 3600.0:.2f} h of the robot")
                if at >= end:
                    break
                time.sleep(_until_next(passed, at / end))
    return _judged(samples, names)


def _until_next(passed: float, share: float) -> float:
    """Return the time [s] until the next sample of the processes' status, so that the whole run has about SAMPLES (200) of them.

    `passed`: wall time since the beginning [s].  `share`: share of the run's simulated time that is done, 0 to 1.
    """
    return _SHORTEST if share <= 0.0 else float(np.clip(passed / share / SAMPLES, _SHORTEST, 60.0))


def _stats(session: Any, names: list[str]) -> dict[str, Stat]:
    return {who: wait_for(partial(stat_of, session, who, 2.0), _PATIENCE, f"{who} answers") for who in names}


def _judged(samples: list[_Sample], names: list[str]) -> dict[str, Any]:
    hours = samples[-1].at / 3600.0
    kept = [sample for sample in samples if sample.at >= WARM * samples[-1].at]
    if len(kept) < 10:
        raise LaunchFailed(f"{len(kept)} samples after the warm-up are too few: run it for more --hours")
    at = np.array([sample.at for sample in kept]) / 3600.0
    processes = {who: _process(at, [sample.stats[who] for sample in kept]) for who in names}
    paces = [(after.passed - before.passed) / max(after.at - before.at, 1e-9) for before, after in zip(kept, kept[1:], strict=False)]
    tenth = max(1, len(paces) // 10)
    slower = float(np.median(paces[-tenth:]) / np.median(paces[:tenth]))
    early, late = (sum((sample.ages for sample in group), Counter[int]()) for group in (kept[1 : tenth + 1], kept[-tenth:]))
    restarted = [who for who in names if len({sample.stats[who].pid for sample in samples}) > 1]
    steady = all(one["grown_mb"] < MOST_GROWTH and not one["more_files"] and not one["more_threads"] for one in processes.values())
    apart = _apart(early, late)
    return {
        "robot_hours": hours,
        "seconds": samples[-1].passed,
        "processes": processes,
        "slower": slower,
        "ages": {"first": _ages(early), "last": _ages(late)},
        "apart": apart,
        "restarted": restarted,
        "load": os.getloadavg()[0],
        "passed": steady and slower <= MOST_SLOWER and apart <= MOST_APART and not restarted,
    }


def _ages(counts: Counter[int]) -> dict[str, float]:
    """Return the median, the 99th percentile and the maximum of the ages [ticks]; `counts`: how often each age occurred."""
    values = np.repeat(list(counts), list(counts.values()))
    if not values.size:
        raise LaunchFailed("the motors obeyed no command in a tenth of the time")
    return {"p50": float(np.percentile(values, 50)), "p99": float(np.percentile(values, 99)), "max": float(values.max())}


def _apart(first: Counter[int], second: Counter[int]) -> float:
    """Return the largest difference of the two distribution functions (the statistic of Kolmogorov and Smirnov)."""
    ages = sorted({*first, *second})
    shares = [np.cumsum([counts[age] for age in ages]) / counts.total() for counts in (first, second)]
    return float(np.abs(shares[0] - shares[1]).max())


def _process(hours: Any, stats: list[Stat]) -> dict[str, float]:
    """Return the memory of one process, and the growth of its memory, open files and threads, from its samples `stats`.

    `hours`: time of each sample [h of the robot].  Keys: "memory_mb", memory at the end [MB]; "slope_mb_per_hour" and "slope_error", slope
    of a straight line fitted to the memory, and its standard error [MB per hour of the robot]; "grown_mb", "more_files" and "more_threads",
    median of the last tenth of the samples minus that of the first tenth.
    """
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
    """Return the result of `measure` as text: a table with one line for each process, then ages and speed."""
    lines = [f"{result['robot_hours']:.2f} robot hours in {result['seconds'] / 60.0:.1f} minutes; load {result['load']:.1f}"]
    lines.append(f"{'process':<18}{'memory MB':>10}{'grown':>8}{'MB per hour':>18}{'files':>8}{'threads':>9}")
    for who, one in result["processes"].items():
        slope = f"{one['slope_mb_per_hour']:.2f} +- {one['slope_error']:.2f}"
        lines.append(
            f"{who:<18}{one['memory_mb']:>10.1f}{one['grown_mb']:>8.1f}{slope:>18}{one['more_files']:>+8.0f}{one['more_threads']:>+9.0f}"
        )
    for which, one in result["ages"].items():
        lines.append(f"Age of commands, {which} tenth: median {one['p50']:.0f}, p99 {one['p99']:.0f}, largest {one['max']:.0f} ticks.")
    lines.append(f"Largest difference of their distribution functions: {result['apart']:.3f}.")
    lines.append(f"A tick of the last tenth over one of the first: {result['slower']:.2f}.")
    lines.append(f"Processes that were started again: {', '.join(result['restarted']) or 'none'}.")
    return "\n".join(lines)
