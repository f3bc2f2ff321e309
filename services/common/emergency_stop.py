# SPDX-License-Identifier: Apache-2.0
"""The emergency stop outside of robot_sim: its record on disk, and its reception from the bus and from datagrams.

`StopRecord` is the record. A client on robot_sim's machine can write it itself (`StopRecord.stop`); robot_sim watches the record, so that
such a stop needs no router. A client on another machine sends the stop as UDP datagrams too (`StopSender`), which robot_sim receives
without the router (`StopDatagrams`). `StopLine` receives stops from the bus.
"""

from __future__ import annotations

import json
import os
import re
import socket
import time
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

import zenoh
from msgspec import Struct
from zenoh.handlers import RingChannel

from bus_schema import VERSION, Refused, decode, encode, encoding_of
from bus_schema.messages import EStop

BY_LAUNCHER = "launcher"  # source of a stop because a vital service was given up; it ends with that launch
FOLDER = "mobee/emergency-stop"  # in the user's folder of states
SILENCE = 0.5  # s without any state of a part, as in a pause, after which the confirmation by robot_sim is sufficient


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

        `source`: name of the process that stops the robot. `reason`: text for the user. If the file records an earlier stop, the new
        one replaces it only if the launcher has set the earlier one and `source` is another process. True: the file exists and records the
        new stop or the earlier one. Raises OSError if the file cannot be written.
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
_LONGEST = 16_384  # bytes; a stop is shorter, also with a reason of 2000 characters of four bytes
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
            if (message := _stop_of(payload, str(sample.encoding))) is not None:
                stops.append(message)
        return stops


def _stop_of(payload: bytes, encoding: str) -> EStop | None:
    """Return the stop in the bytes of a message; None if it sets no stop or cannot be decoded."""
    if _SETS not in payload:
        return None
    try:
        message = decode(EStop, payload, encoding)
    except Refused:
        return None
    return message if message.set else None


_CONFIRMED = b"mobee stopped"  # the answer; it is no stop, so that two receivers never answer each other


def datagram_address(endpoint: str) -> str:
    """Return the UDP address HOST:PORT to which a stop of a robot is sent as a datagram.

    `endpoint`: address at which the robot's router listens. The UDP port has the same number as its TCP port. The result is empty if the
    endpoint is secured (a datagram does not prove who sent it), or if only processes of the same machine can use the endpoint.
    """
    return re.split("[?#]", endpoint.removeprefix("tcp/"))[0] if endpoint.startswith("tcp/") else ""


def _open_socket(address: str) -> tuple[socket.socket, Any]:
    """Return a UDP socket of the family of the address HOST:PORT, and this address for the socket; raises OSError."""
    host, _, port = address.rpartition(":")
    family, kind, protocol, _, place = socket.getaddrinfo(host.strip("[]"), port, type=socket.SOCK_DGRAM)[0]
    opened = socket.socket(family, kind, protocol)
    opened.setblocking(False)
    return opened, place


class StopDatagrams:
    """Receives emergency stops as UDP datagrams: a client on another machine stops the robot without the router.

    A datagram is an `EStop` message, encoded as on the bus. Datagrams that set no stop, or cannot be decoded, are dropped: a datagram never
    releases the robot.
    """

    def __init__(self, address: str) -> None:
        """Receive at the address HOST:PORT; raises OSError if it cannot be used."""
        self._socket, place = _open_socket(address)
        self._senders: list[Any] = []
        try:
            self._socket.bind(place)
        except OSError:
            self._socket.close()
            raise

    def take(self) -> list[EStop]:
        """Return the stops that have arrived since the last call."""
        stops = []
        for _ in range(_WAITING):
            try:
                payload, sender = self._socket.recvfrom(_LONGEST)
            except BlockingIOError:
                break
            except OSError:  # of an answer that did not arrive
                continue
            if (message := _stop_of(payload, encoding_of(EStop))) is not None:
                stops.append(message)
                self._senders.append(sender)
        return stops

    def confirm(self) -> None:
        """Send the answer that robot_sim obeys the stop to the senders of all stops that `take` has returned since the last call."""
        for sender in self._senders:
            with suppress(OSError):  # the sender repeats the stop until it has an answer
                self._socket.sendto(_CONFIRMED, sender)
        self._senders.clear()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


class StopSender:
    """Sends an emergency stop to robot_sim as UDP datagrams.

    It needs no router, and nothing happens if no robot_sim receives datagrams.

    Args:
        endpoint: address of the router.
        source: name of the process that stops the robot.
        reason: text for the user.
    """

    def __init__(self, endpoint: str, source: str, reason: str) -> None:
        self._payload = encode(
            EStop(v=VERSION, run="-", src=source, seq=0, k=0, t=0, tw=time.monotonic_ns(), set=True, source=source, reason=reason)
        )
        self._socket: socket.socket | None = None
        self._confirmed = False
        with suppress(OSError):  # the record and the bus remain
            if address := datagram_address(endpoint):
                self._socket, place = _open_socket(address)
                self._socket.connect(place)

    def send(self) -> None:
        """Send the stop once; datagrams can be lost, so callers repeat it until `is_confirmed`, or until the parts report the stop."""
        if self._socket is not None:
            with suppress(OSError):
                self._socket.send(self._payload)

    def is_confirmed(self) -> bool:
        """Return whether robot_sim has answered that it obeys the stop."""
        if self._socket is not None:
            with suppress(OSError):  # nothing has arrived, or no process receives at the address
                self._confirmed = self._confirmed or self._socket.recv(_LONGEST) == _CONFIRMED
        return self._confirmed

    def __enter__(self) -> StopSender:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._socket is not None:
            self._socket.close()
