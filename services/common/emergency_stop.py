# SPDX-License-Identifier: Apache-2.0
"""The emergency stop beyond one process: its record on disk, and the session on which robot_sim hears it."""

from __future__ import annotations

import json
import os
import re
import time
from collections.abc import Callable
from pathlib import Path

import zenoh
from msgspec import Struct
from zenoh.handlers import Callback

from bus_schema import Refused, decode
from bus_schema.messages import EStop

BY_LAUNCHER = "launcher"  # source of a stop because a vital service was given up; it ends with that launch
FOLDER = "mobee/emergency-stop"  # in the user's folder of states


class Stop(Struct, frozen=True):
    """An emergency stop that has not been released."""

    source: str
    reason: str
    time: float = 0.0  # s since 1970; 0: unknown

    def __str__(self) -> str:
        since = time.strftime(" since %Y-%m-%d %H:%M:%S", time.localtime(self.time)) if self.time else ""
        return f"emergency stop by {self.source}{since}: {self.reason}"


def replaces(new: Stop, old: Stop | None) -> bool:
    """Return whether a stop is kept in place of another: the stop of a launcher ends with it, that of any other client does not."""
    return old is None or (old.source == BY_LAUNCHER and new.source != BY_LAUNCHER)


class StopRecord:
    """A file that says whether the robot is stopped, so that a stop outlives every process.

    A file that does not exist or cannot be read counts as a stop: only a record of a release lets the robot move.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    @classmethod
    def of_endpoint(cls, endpoint: str) -> StopRecord:
        """The record of the robot that is reached at an endpoint of this machine; all its runs share it."""
        states = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local/state")
        return cls(states / FOLDER / f"{re.sub(r'[^A-Za-z0-9]+', '-', endpoint).strip('-')}.json")

    @property
    def path(self) -> Path:
        """The file."""
        return self._path

    def create(self) -> None:
        """Record that the robot is not stopped, unless there is a record; raises OSError."""
        if not self._path.exists():
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self.release()

    def remove(self) -> None:
        """Remove the record at the end of a launch, unless a stop is in force; raises OSError."""
        if self.read() is None:
            self._path.unlink(missing_ok=True)

    def read(self) -> Stop | None:
        """The stop in force; None if the robot is released."""
        try:
            found = json.loads(self._path.read_bytes())
            if found["stopped"] is False:
                return None
            return Stop(str(found["source"]), str(found["reason"]), float(found["time"]))
        except (OSError, ValueError, LookupError, TypeError, RecursionError) as error:
            return Stop("robot_sim", f"the record of emergency stops {self._path} cannot be read ({type(error).__name__})")

    def latch(self, stop: Stop) -> None:
        """Record a stop; raises OSError."""
        self._write({"stopped": True, "source": stop.source, "reason": stop.reason, "time": stop.time})

    def release(self) -> None:
        """Record that the robot is released; raises OSError."""
        self._write({"stopped": False, "time": time.time(), "monotonic_ns": time.monotonic_ns()})

    def released_at(self) -> int:
        """Time of the last release [ns, monotonic clock]; 0 if it is not known."""
        try:
            return int(json.loads(self._path.read_bytes()).get("monotonic_ns", 0))
        except (OSError, ValueError, AttributeError, TypeError, RecursionError):
            return 0

    def _write(self, record: dict[str, object]) -> None:
        """Replace the file as a whole; it is on the disk when this returns."""
        draft = self._path.with_name(f"{self._path.name}.{os.getpid()}")
        with draft.open("w") as file:
            json.dump(record, file)
            file.flush()
            os.fsync(file.fileno())
        draft.replace(self._path)
        folder = os.open(self._path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


class StopLine:
    """Hears emergency stops on a session of its own, which no other stream can fill.

    Zenoh's thread keeps the first stop that comes; everything else on this key is dropped there, so that a flood does not fill the inbox.
    """

    def __init__(self, session: zenoh.Session, arrived: Callable[[], None], is_own: Callable[[EStop], bool]) -> None:
        """Begin to listen; both functions are called in Zenoh's thread.

        `arrived`: a stop waits to be taken.  `is_own`: whether this process has published the message, which is then dropped.
        """
        self._stop: EStop | None = None
        self._arrived, self._is_own = arrived, is_own
        self.refused = 0  # messages that cannot be decoded
        self._subscriber = session.declare_subscriber(EStop.stream.key(), Callback(self._note, indirect=False))

    def take(self) -> EStop | None:
        """The stop that came since the last call; None if there is none."""
        stop, self._stop = self._stop, None
        return stop

    def _note(self, sample: zenoh.Sample) -> None:
        if self._stop is not None:
            return
        try:
            message = decode(EStop, sample.payload.to_bytes(), str(sample.encoding))
        except Refused:
            self.refused += 1
            return
        if message.set and not self._is_own(message):
            self._stop = message
            self._arrived()
