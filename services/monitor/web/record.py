# SPDX-License-Identifier: Apache-2.0
"""Keeps what the page showed, so that it can be shown again: a line of JSON for each new value."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

from mobee.errors import MobeeError

STORY = "story.jsonl"  # in the folder of a run
LEFT_OUT = ("body", "control", "events")  # recorded in other forms: motor positions, single events; or not at all
SHOWN_EVENTS = 60  # the newest
SELDOM = {"curves": 10.0, "baselines": 10.0}  # s of the robot between two values that are recorded: a curve is long, and grows slowly
FULL = 500_000_000  # bytes at which a record ends


@dataclass(frozen=True, slots=True)
class Entry:
    """A value at a time, s of the robot."""

    time: float
    name: str
    value: Any


class Record:
    """A file that grows; any thread may write."""

    def __init__(self, path: Path, now: Callable[[], float]) -> None:
        """`now`: the robot's time, s."""
        self._file = path.open("a", encoding="utf-8", buffering=1 << 16)
        self._next: dict[str, float] = {}  # s, by name
        self._now, self._lock, self._size = now, Lock(), path.stat().st_size

    def put(self, name: str, text: str) -> None:
        """Write a value, given as JSON text."""
        now = self._now()
        if name in LEFT_OUT or now < self._next.get(name, now):
            return
        if name in SELDOM:
            self._next[name] = now + SELDOM[name]
        line = f'[{now:.3f},"{name}",{text}]\n'
        with self._lock:
            if self._size + len(line) < FULL and not self._file.closed:
                self._file.write(line)
                self._size += len(line)

    def flush(self) -> None:
        """Give what was written to the operating system: it survives a kill of this process."""
        with self._lock:
            if not self._file.closed:
                self._file.flush()

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._file.close()


def entries(path: Path) -> list[Entry]:
    """Return what a file holds, in order; a last line that was cut off is left out.  Raises MobeeError if it cannot be read."""
    try:
        return list(_read(path))
    except OSError as error:
        raise MobeeError(f"{path}: cannot be read ({error.strerror}); only runs that had a monitor have this file.") from None


def _read(path: Path) -> Iterator[Entry]:
    with path.open(encoding="utf-8") as file:
        for number, line in enumerate(file, start=1):
            if not line.endswith("\n"):
                return
            try:
                when, name, value = json.loads(line)
                yield Entry(float(when), str(name), value)
            except (ValueError, TypeError, RecursionError):
                raise MobeeError(f"{path}:{number}: not a line of a story; was the file edited?") from None
