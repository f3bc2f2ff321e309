# SPDX-License-Identifier: Apache-2.0
"""Records the values that the page shows, so that they can be shown again: a file with one line of JSON for each new value."""

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
    """One recorded value, with its name and the robot's time `time` [s]."""

    time: float
    name: str
    value: Any


class Record:
    """The file that records the values of the page, one line of JSON for each value, up to 500 MB.

    A line that would exceed this size is not written. Any thread may write.
    """

    def __init__(self, path: Path, now: Callable[[], float]) -> None:
        """Open the file `path` of the recorded values; `now`: returns the robot's time [s]."""
        self._file = path.open("a", encoding="utf-8", buffering=1 << 16)
        self._next: dict[str, float] = {}  # s, by name
        self._now, self._lock, self._size = now, Lock(), path.stat().st_size

    def put(self, name: str, text: str) -> None:
        """Append a value, its name and the robot's present time to the file.

        `text`: the value as JSON. The values named curves and baselines are written at most every 10 s of the robot's time; those named
        body, control and events are never written.
        """
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
        """Hand all written lines to the operating system, so that they are kept even if this process is killed."""
        with self._lock:
            if not self._file.closed:
                self._file.flush()

    def close(self) -> None:
        """Close the file of the recorded values; later values are not recorded."""
        with self._lock:
            self._file.close()


def entries(path: Path) -> list[Entry]:
    """Return the values in a record file, in the order of the file.

    An incomplete last line is left out. Raises MobeeError if the file cannot be read, or a line is not valid.
    """
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
