# SPDX-License-Identifier: Apache-2.0
"""The health of a process: rate, age and gaps of the ticks that it gets, refused messages, memory, open files; and their limits."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from pathlib import Path

WINDOW = 5.0  # s over which rate, gap and refusals are measured
SETTLED = 30.0  # s after the start; the memory of that time is what growth is compared with
RECOVERED = 30.0  # s within its limit after which a value is good again, so that one at its limit is not reported all the time
SLOW = 0.8  # share of the expected rate
LONG_GAP = 0.15  # s in real time, beyond the period
GROWTH, GROWN = 1.5, 100.0  # memory: factor and MB beyond that of the start
MANY_FILES = 0.8  # share of the files that the process may open
MANY_REFUSED = 10.0  # a second
CROWD = 500  # waiting messages and calls


class Beats:
    """Counts events that should come at a fixed rate; times are in s of the monotonic clock."""

    def __init__(self, now: float) -> None:
        self._begun, self._count, self._gap = now, 0, 0.0
        self._last: float | None = None
        self.rate: float | None = None  # Hz, of the last whole window
        self.gap: float | None = None  # s, the longest in it

    def note(self, now: float) -> None:
        """Record an event at the time `now` [s]."""
        if self._last is not None and now - self._last > self._gap:
            self._gap = now - self._last
        self._last = now
        self._count += 1

    def age(self, now: float) -> float | None:
        """Return the time from the last event to `now`, s; None if there was none."""
        return None if self._last is None else now - self._last

    def end_window(self, now: float) -> None:
        """End the present window (the period in which events are counted) at the time `now` [s], and begin a new one.

        Sets `rate`, the events per second in the window [Hz], and `gap`, the longest time without an event that ended in it, or still lasts
        [s]. Both stay None before the first event.
        """
        if self._last is not None:
            self.rate, self.gap = self._count / (now - self._begun), max(self._gap, now - self._last)
        self._begun, self._count, self._gap = now, 0, 0.0


class Health:
    """Measures the health of this process, and warns of values that are beyond their limits; call `check` every WINDOW (5 s).

    The values are the rate of the clock's ticks and the longest gap between them, refused messages per second, waiting messages and calls,
    memory, and open files. Warnings go to the function `report` that is given to `check`.

    `files_limit`: largest number of files that the process may open; a warning is given above 80 % of it. None: the limit of the system; if
    that is unknown, open files are not judged.
    """

    def __init__(self, files_limit: int | None = None) -> None:
        now = time.monotonic()
        self.beats = Beats(now)
        self._files_limit = files_limit if files_limit is not None else _files_limit()
        self._begun = self._checked = now
        self._memory_then: float | None = None  # MB
        self._refused, self._refused_rate = 0, 0.0
        self.bad: dict[str, float] = {}  # numbers beyond their limits: the time [s] of the last check that found each

    def numbers(self, waiting: int) -> dict[str, int | float | None]:
        """Return the present numbers, by name; None: not measured.

        "rate", "gap_ms": rate of the ticks [Hz], and longest time between two ticks, between the last two calls of `check`. "age_ms": time
        since the last tick. "refused_rate": refused messages per second. "memory_mb", "files", "threads": memory, open files and threads of
        the process. "waiting": number of messages and calls in the inbox, as given by `waiting`.
        """
        age, gap = self.beats.age(time.monotonic()), self.beats.gap
        return {
            "rate": self.beats.rate,
            "age_ms": None if age is None else 1e3 * age,
            "gap_ms": None if gap is None else 1e3 * gap,
            "refused_rate": self._refused_rate,
            "memory_mb": _memory(),
            "files": _files(),
            "threads": threading.active_count(),
            "waiting": waiting,
        }

    def check(self, expected: float | None, refused: int, waiting: int, report: Callable[[str, str], None]) -> None:
        """Compare the values since the last call with their limits, and report those that became bad or good.

        `expected`: rate of the ticks, Hz; None in lockstep or without a clock. `refused`: number of refused messages since the start.
        `waiting`: number of messages and calls in the inbox. `report(level, text)`: called when a value goes beyond its limit ("warning"),
        and when it has been within the limit for some time ("info").
        """
        now = time.monotonic()
        self.beats.end_window(now)
        self._refused_rate = max(0, refused - self._refused) / max(now - self._checked, 1e-3)
        self._refused, self._checked = refused, now
        memory = _memory()
        if self._memory_then is None and now - self._begun > SETTLED:
            self._memory_then = memory
        for name, text in self._judged(expected, waiting, memory).items():
            if name not in self.bad:
                report("warning", text)
            self.bad[name] = now
        for name in [name for name, found in self.bad.items() if now - found > RECOVERED]:
            del self.bad[name]
            report("info", f"{name} has been within its limit for {RECOVERED:g} s")

    def _judged(self, expected: float | None, waiting: int, memory: float | None) -> dict[str, str]:
        bad, rate, gap, files = {}, self.beats.rate, self.beats.gap, _files()
        if expected is not None and rate is not None and rate < SLOW * expected:
            bad["rate"] = f"gets {rate:.0f} ticks a second of {expected:.0f}"
        if expected is not None and gap is not None and gap > LONG_GAP + 1.0 / expected:
            bad["gap"] = f"got no tick for {1e3 * gap:.0f} ms"
        if self._refused_rate > MANY_REFUSED:
            bad["refused"] = f"refuses {self._refused_rate:.0f} messages a second"
        if waiting > CROWD:
            bad["waiting"] = f"{waiting} messages and calls wait"
        before = self._memory_then
        if memory is not None and before is not None and memory > max(GROWTH * before, before + GROWN):
            bad["memory"] = f"has {memory:.0f} MB of memory, {before:.0f} MB after its start"
        if files is not None and self._files_limit is not None and files > MANY_FILES * self._files_limit:
            bad["files"] = f"has {files} files open of {self._files_limit}"
        return bad


def _memory() -> float | None:
    """Resident memory of this process, MB; None without Linux's /proc."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    except (OSError, ValueError, IndexError):
        return None


def _files() -> int | None:
    try:
        return len(os.listdir("/proc/self/fd"))
    except OSError:
        return None


def _files_limit() -> int | None:
    try:
        import resource
    except ImportError:
        return None
    return resource.getrlimit(resource.RLIMIT_NOFILE)[0]
