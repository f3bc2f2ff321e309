# SPDX-License-Identifier: Apache-2.0
"""Records the values that the page shows, so that they can be shown again: a file with one line of JSON for each new value."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from io import FileIO
from mmap import ACCESS_READ, mmap
from pathlib import Path
from threading import Lock
from typing import Any

from mobee.errors import MobeeError

STORY = "story.jsonl"  # in the folder of a run
LEFT_OUT = ("body", "control", "events")  # recorded in other forms: motor positions, single events; or not at all
SHOWN_EVENTS = 60  # the newest
SELDOM = {"curves": 10.0, "baselines": 10.0}  # s of the robot between two values that are recorded: a curve is long, and grows slowly
FULL = 500_000_000  # bytes at which a record ends
BUFFER = 1 << 16  # bytes of lines that wait to be written


@dataclass(frozen=True, slots=True)
class Entry:
    """One recorded value, with its name and the robot's time `time` [s]."""

    time: float
    name: str
    value: Any


class Record:
    """The file that records the values of the page, one line of JSON for each value, up to 500 MB.

    A line that would exceed this size is not written. While the file cannot be written, for example because the disk is full, the values
    are lost, and `trouble` is the reason; the file always ends with a complete line. Any thread may write. If the file has values of an
    earlier monitor, their times are continued: no time is before that of the last line.
    """

    def __init__(self, path: Path, now: Callable[[], float]) -> None:
        """Open the file `path` of the recorded values, and remove its last line if it is incomplete.

        `now`: returns the robot's time [s].
        """
        self._file = path.open("ab", buffering=0)
        self._size = _end_of_lines(path)  # bytes of complete lines
        self._file.truncate(self._size)
        self._end = _last_time(path)  # s, of an earlier monitor
        self._shift: float | None = None  # s that are added to the robot's time; None: no time is known yet
        self._waiting = b""  # lines
        self._next: dict[str, float] = {}  # s, by name
        self._now, self._lock = now, Lock()
        self.trouble = ""

    def put(self, name: str, text: str) -> None:
        """Append a value, its name and the robot's present time to the file.

        `text`: the value as JSON. The values named curves and baselines are written at most every 10 s of the robot's time; those named
        body, control and events are never written.
        """
        now = self._now()
        if self._shift is None and now > 0.0:
            self._shift = max(0.0, self._end - now)  # the robot may have begun a new run
        now = self._end if self._shift is None else now + self._shift
        if name in LEFT_OUT or now < self._next.get(name, now):
            return
        if name in SELDOM:
            self._next[name] = now + SELDOM[name]
        line = f'[{now:.3f},"{name}",{text}]\n'.encode()
        with self._lock:
            if self._size + len(self._waiting) + len(line) < FULL and not self._file.closed:
                self._waiting += line
                if len(self._waiting) > BUFFER:
                    self._write()

    def flush(self) -> None:
        """Hand all written lines to the operating system, so that they are kept even if this process is killed."""
        with self._lock:
            if not self._file.closed:
                self._write()

    def close(self) -> None:
        """Close the file of the recorded values; later values are not recorded."""
        with self._lock:
            if not self._file.closed:
                self._write()
                self._file.close()

    def _write(self) -> None:
        """Write the lines that wait; if that fails, they are lost, and none of them stays in part."""
        lines, self._waiting = self._waiting, b""
        if not lines:
            return
        try:
            if self.trouble:
                self._file.truncate(self._size)
            _write_all(self._file, lines)
        except OSError as error:
            self.trouble = error.strerror or str(error)
            with suppress(OSError):  # before the next lines it is tried again
                self._file.truncate(self._size)
        else:
            self._size += len(lines)
            self.trouble = ""


def _write_all(file: FileIO, data: bytes) -> None:
    """Write data to an unbuffered file, which may take a part of them at a time."""
    left = memoryview(data)
    while left:
        left = left[file.write(left) :]


def _end_of_lines(path: Path) -> int:
    """Return the number of bytes up to the end of the last complete line of a file."""
    if not path.stat().st_size:
        return 0
    with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as content:
        return content.rfind(b"\n") + 1


def _last_time(path: Path) -> float:
    """Return the time in the last line of a file of complete lines; 0 if there is none, or it is not valid."""
    if not path.stat().st_size:
        return 0.0
    with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as content:
        line = content[content.rfind(b"\n", 0, len(content) - 1) + 1 :]
    try:
        return float(json.loads(line)[0])
    except (ValueError, TypeError, LookupError, RecursionError):
        return 0.0


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
