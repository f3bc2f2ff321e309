# SPDX-License-Identifier: Apache-2.0
"""Sends data to 3D viewers in browsers. A viewer requests its next frame when it has shown the last one, so a slow viewer skips frames."""

from __future__ import annotations

import struct
import time
from collections import deque
from threading import Condition
from typing import Any, Protocol

import rerun as rr
import rerun.blueprint as rrb

LARGEST_HISTORY = 4_000_000  # bytes of changes that a new viewer gets
RECORDED = 4  # of so many updates of the robot one is recorded, five a second: to log one takes 4 ms of a core
WANTED_FOR = 15.0  # s after its last request for which a viewer counts as open, and changes are kept for it


class Stream(Protocol):
    """The methods of a Rerun recording stream that the 3D scene uses."""

    def log(self, path: str | list[object], *what: Any, static: bool = False) -> None:
        """Log Rerun components on the entity `path` at the current time; `static`: True for data without a time."""


class _Part:
    """A recording stream whose bytes are collected; each piece is a complete file of Rerun."""

    def __init__(self, recording_id: str) -> None:
        self.stream = rr.RecordingStream("mobee", recording_id=recording_id)
        self._bytes = rr.binary_stream(self.stream)
        self.is_dirty = False

    def log(self, path: str | list[object], *what: Any, static: bool) -> None:
        self.stream.log(path, *what, static=static)
        self.is_dirty = True

    def take(self) -> bytes:
        """Return the data logged since the last call; empty if there are none."""
        if not self.is_dirty:
            return b""
        self.is_dirty = False
        return self._bytes.read(flush=True) or b""

    def close(self) -> None:
        """End the stream; Rerun warns of bytes that were not read."""
        self.stream.disconnect()
        self._bytes.read(flush=True)


class Frames:
    """A stream that keeps data for open viewers, and also logs to `file` unless it is None.

    It has three kinds of data. Static data have no time; all are kept. An update is the data logged between `begin_update` and
    `end_update`: the robot's pose, and what changes with it. Only the newest update is kept; an update is kept only if a viewer waits for
    it, and the file gets every fourth one. All other data are changes, such as events; the newest 4 MB that were logged while a viewer was
    open are kept.
    """

    def __init__(self, file: rr.RecordingStream | None, layout: rrb.Blueprint, recording_id: str) -> None:
        self._file = file
        self._static, self._changes, self._update = (_Part(recording_id) for _ in range(3))
        self._static.stream.send_blueprint(layout)
        self._static.is_dirty = True
        self._kept: list[tuple[int, bytes]] = []  # static pieces, by the number of the frame in which they came
        self._history: deque[tuple[int, bytes]] = deque()
        self._size = 0  # bytes of the history
        self._newest = (0, 0.0, b"")  # number, s of robot time, the update
        self._published = Condition()
        self._asked, self._waiting = -WANTED_FOR, 0
        self._is_in_update = self._is_wanted = self._is_recorded = False
        self._updates = 0
        self._time = 0.0

    def log(self, path: str | list[object], *what: Any, static: bool = False) -> None:
        """Log Rerun components on the entity `path`, to the file and for the viewers.

        Data that neither the file nor an open viewer needs are dropped; static data are always kept.
        """
        if self._file is not None and (self._is_recorded or not self._is_in_update):
            self._file.log(path, *what, static=static)
        if static:
            self._static.log(path, *what, static=True)
        elif not self._is_in_update:
            if time.monotonic() - self._asked < WANTED_FOR:
                self._changes.log(path, *what, static=False)
        elif self._is_wanted:
            self._update.log(path, *what, static=False)

    def set_time(self, timeline: str, seconds: float) -> None:
        """Set the time of all following logs to `seconds` on a timeline."""
        self._time = seconds
        for stream in (self._file, self._changes.stream, self._update.stream):
            if stream is not None:
                stream.set_time(timeline, duration=seconds)

    def close(self) -> None:
        """End the streams, and discard the data that no viewer has requested. Nothing can be logged afterwards."""
        for part in (self._static, self._changes, self._update):
            part.close()

    def begin_update(self) -> bool:
        """Begin an update of the whole robot, which `end_update` completes.

        Returns True if a viewer or the file needs this update; else the caller need not log it.
        """
        self._is_in_update = True
        self._is_recorded = self._file is not None and self._updates % RECORDED == 0
        self._updates += 1
        with self._published:
            self._is_wanted = self._waiting > 0
        return self._is_wanted or self._is_recorded

    def end_update(self) -> None:
        """End the update; send it to the viewers that wait, together with all changes since the previous one."""
        self._is_in_update = False
        if not self._is_wanted:
            return
        static, changes, update = self._static.take(), self._changes.take(), self._update.take()
        with self._published:
            number = self._newest[0] + 1
            if static:
                self._kept.append((number, static))
            if changes:
                self._history.append((number, changes))
                self._size += len(changes)
            while self._size > LARGEST_HISTORY:
                self._size -= len(self._history.popleft()[1])
            self._newest = (number, self._time, update)
            self._published.notify_all()

    def newest(self, after: int, patience: float) -> bytes:
        """Return the data that a viewer needs after it has shown frame `after`. Any thread may call this.

        The call waits for a newer frame for at most `patience` s. The bytes, all little-endian: number of the frame (uint64), its time
        (float64, s), and pieces of data. Each piece is a complete Rerun file; before it stands its length in bytes (uint32). If there is no
        newer frame, there are no pieces.
        """
        give_up = time.monotonic() + patience
        with self._published:
            self._asked = time.monotonic()
            self._waiting += 1
            try:
                while self._newest[0] <= after and (left := give_up - time.monotonic()) > 0.0:
                    self._published.wait(left)
            finally:
                self._waiting -= 1
            number, when, update = self._newest
            if after > number:
                after = 0
            pieces = [piece for count, piece in (*self._kept, *self._history) if count > after]
            if number > after:
                pieces.append(update)
        return b"".join([struct.pack("<Qd", number, when), *(struct.pack("<I", len(piece)) + piece for piece in pieces)])
