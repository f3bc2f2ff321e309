# SPDX-License-Identifier: Apache-2.0
"""Measures how long processes wait for a processor. The launcher uses it to distinguish slow services from frozen ones."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PERIOD = 0.2  # s between two readings of the threads


@dataclass(frozen=True, slots=True)
class _Thread:
    """The time that a thread has run and waited for a processor, measured at one moment; the units are beside the fields."""

    ran: int  # ns on a processor since its start
    waited: float  # s ready to run without one, up to the last time that it ran
    since: float | None  # monotonic time since when it has been waiting; None if it is not waiting

    def waited_until(self, now: float) -> float:
        return self.waited + (0.0 if self.since is None else now - self.since)


class Starvation:
    """Measures how long several processes have waited for a processor, from the counts of the Linux scheduler.

    `total`: waiting time [s] since the start of the measurement; 0 where Linux does not report it. The waiting times of all threads are
    added, because several threads handle a call one after the other. Between two updates `total` grows by at most the time between them.
    """

    def __init__(self, pids: tuple[int, ...], now: float) -> None:
        self._pids, self._at, self.total = pids, now, 0.0
        self._threads = {thread: _Thread(ran, waited, None) for thread, ran, waited, _ in _threads(pids)}

    def update(self, now: float) -> None:
        """Measure `total` up to the monotonic time `now` [s]. A call less than 0.2 s after the last update changes nothing."""
        if now < self._at + PERIOD:
            return
        found: dict[int, _Thread] = {}
        waits = 0.0
        for thread, ran, waited, is_ready in _threads(self._pids):
            before = self._threads.get(thread, _Thread(-1, waited, None))
            begun = (self._at if before.since is None else before.since) if is_ready and ran == before.ran else None
            found[thread] = _Thread(ran, waited, begun)
            waits += found[thread].waited_until(now) - before.waited_until(self._at)
        self.total += min(waits, now - self._at)
        self._threads, self._at = found, now


def _threads(pids: tuple[int, ...]) -> Iterator[tuple[int, int, float, bool]]:
    """Yield id, ns on a processor, s of waiting, and whether it runs or is ready to, for each thread of the processes that still run."""
    for pid in pids:
        try:
            ids = os.listdir(f"/proc/{pid}/task")
        except OSError:  # the process has ended, or this is not Linux
            continue
        for thread in ids:
            folder = Path(f"/proc/{pid}/task/{thread}")
            try:
                ran, waited, _ = (folder / "schedstat").read_text().split()
                state = (folder / "stat").read_text().rpartition(")")[2].split()[0]
            except (OSError, ValueError):  # the thread has ended, or the kernel keeps no such numbers
                continue
            yield int(thread), int(ran), 1e-9 * int(waited), state == "R"
