# SPDX-License-Identifier: Apache-2.0
"""The emergency stop outside of robot_sim: its record on disk (`StopRecord`), and its reception from the bus (`StopLine`).

A client on robot_sim's machine can write the record itself (`StopRecord.stop`). robot_sim watches the record, so that such a stop needs no
router.
"""

from __future__ import annotations

import json
import os
import re
import time
from pathlib import Path

import zenoh
from msgspec import Struct
from zenoh.handlers import RingChannel

from bus_schema import Refused, decode
from bus_schema.messages import EStop

BY_LAUNCHER = "launcher"  # source of a stop because a vital service was given up; it ends with that launch
FOLDER = "mobee/emergency-stop"  # in the user's folder of states


class Stop(Struct, frozen=True):
    """An emergency stop that has not been released.

    `source`: name of the process that stopped the robot. `reason`: text for the user. `time`: time of the stop, s since 1970; 0: not known.
    """

    source: str
    reason: str
    time: float = 0.0

    def __str__(self) -> str:
        since = time.strftime(" since %Y-%m-%d %H:%M:%S", time.localtime(self.time)) if self.time else ""
        return f"emergency stop by {self.source}{since}: {self.reason}"


def replaces(new: Stop, old: Stop | None) -> bool:
    """Return whether the stop `new` replaces the stop `old` in the record; `old` is None if the robot is not stopped.

    It replaces None. It also replaces a stop that the launcher has set, if another process sets `new`. The reason: the next run of the
    launcher releases a stop that a launcher has set, but a stop by another process must remain.
    """
    return old is None or (old.source == BY_LAUNCHER and new.source != BY_LAUNCHER)


class StopRecord:
    """A file that records whether the robot is stopped, so that a stop outlives every process.

    A file that does not exist or cannot be read counts as a stop: the robot moves only if the file records a release.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._seen: tuple[int, int] | None = None  # inode and time of the last change

    @classmethod
    def of_endpoint(cls, endpoint: str, states: Path | None = None) -> StopRecord:
        """Return the record of the robot that is reached at an endpoint of this machine; all runs of the robot share it.

        `states`: folder of a user in which programs keep their state files, such as ~/.local/state. It must be the folder of the user who
        has launched the robot. None: the folder of the user of this process.
        """
        endpoint = re.sub("^(tls|quic)/", "tcp/", endpoint)  # a stop stays in force with or without security
        states = states or Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local/state")
        return cls(states / FOLDER / f"{re.sub(r'[^A-Za-z0-9]+', '-', endpoint).strip('-')}.json")

    @property
    def path(self) -> Path:
        """Path of the file in which the emergency stop is recorded."""
        return self._path

    def create(self) -> None:
        """Make the record's file, with the content that the robot is released; an existing file stays.

        Raises OSError if the file or its folder cannot be made.
        """
        if not self._path.exists():
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self.release()

    def remove(self) -> None:
        """Remove the file if it records that the robot is released; the launcher calls this when its run ends.

        A file that records a stop or cannot be read stays. Raises OSError if the file cannot be removed.
        """
        if self.read() is None:
            self._path.unlink(missing_ok=True)

    def read(self) -> Stop | None:
        """Return the recorded stop; None if the file records that the robot is released.

        If the file does not exist or cannot be read, return a stop with the reason that the record cannot be read.
        """
        try:
            found = json.loads(self._path.read_bytes())
            if found["stopped"] is False:
                return None
            return Stop(str(found["source"]), str(found["reason"]), float(found["time"]))
        except (OSError, ValueError, LookupError, TypeError, RecursionError) as error:
            return Stop("robot_sim", f"the record of emergency stops {self._path} cannot be read ({type(error).__name__})")

    def new_stop(self) -> Stop | None:
        """Return the stop that the file records (as `read`), if the file has changed since the last call, and at the first call.

        Returns None if the file has not changed, records that the robot is released, or does not exist: the launcher removes the file when
        its run ends.
        """
        try:
            found = self._path.stat()
        except OSError:
            return None
        if self._seen == (seen := (found.st_ino, found.st_mtime_ns)):
            return None
        self._seen = seen
        return self.read() if self._path.exists() else None

    def stop(self, source: str, reason: str) -> bool:
        """Record a new stop; return False if the file does not exist, because then no robot_sim watches it.

        `source`: name of the process that stops the robot. `reason`: text for the user. If the file records a stop already, this stop is
        replaced only if the launcher has set it and `source` is another process. True: the file exists, and records the new stop or the
        earlier one. Raises OSError if the file cannot be written.
        """
        if not self._path.exists():
            return False
        new = Stop(source, reason, time.time())
        if replaces(new, self.read()):
            self.latch(new)
        return True

    def latch(self, stop: Stop) -> None:
        """Record a stop in place of the present content of the record's file; raises OSError if it cannot be written."""
        self._write({"stopped": True, "source": stop.source, "reason": stop.reason, "time": stop.time})

    def release(self) -> None:
        """Record that the robot is released; raises OSError if the record's file cannot be written."""
        self._write({"stopped": False, "time": time.time(), "monotonic_ns": time.monotonic_ns()})

    def released_at(self) -> int:
        """Return the time of the last release, ns of the monotonic clock; 0 if the file records a stop or cannot be read."""
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


_WAITING = 1024  # messages that Zenoh keeps; senders repeat a stop, so that the newest are enough
_LONGEST = 4096  # bytes; a stop is shorter
_SETS = b"set\xc3"  # the field `set` = true in msgpack


class StopLine:
    """Receives emergency stops from the bus, also during a flood of messages.

    Zenoh keeps the newest messages without running any Python. A flood takes no time from the process, except about a microsecond for each
    message that sets no stop.
    """

    def __init__(self, session: zenoh.Session) -> None:
        """Subscribe to emergency stops; a process that must receive a stop through every flood of messages gives a session of its own."""
        self._subscriber = session.declare_subscriber(EStop.stream.key(), RingChannel(_WAITING))

    def take(self) -> list[EStop]:
        """Return the stops that have arrived since the last call; messages that set no stop, or cannot be decoded, are dropped."""
        stops = []
        for _ in range(_WAITING):
            sample = self._subscriber.try_recv()
            if sample is None:
                break
            payload = sample.payload.to_bytes() if len(sample.payload) <= _LONGEST else b""
            if _SETS not in payload:
                continue
            try:
                message = decode(EStop, payload, str(sample.encoding))
            except Refused:
                continue
            if message.set:
                stops.append(message)
        return stops
