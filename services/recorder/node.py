# SPDX-License-Identifier: Apache-2.0
"""Runs the recorder: twice per second, it writes the messages that have arrived."""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Iterable, Mapping
from pathlib import Path

import msgspec
from msgspec import Struct

from bus_schema import UNDECODABLE, encoding_of
from bus_schema.messages import (
    Camera,
    Clock,
    Command,
    Commands,
    Contacts,
    Count,
    Follow,
    Forces,
    Image,
    Message,
    Motion,
    Pose,
    Reach,
    State,
    Targets,
    Tick,
    Truth,
)
from bus_schema.page import streams
from mobee.robot.robot import Robot
from services.common.service import Service, return_free_memory
from services.common.session import receive_together, sockets_at
from services.common.tap import Raw, Tap
from services.recorder.config import Config
from services.recorder.files import Channel, Files
from services.recorder.views import Views

PERIOD = 0.5  # s between two checks for new messages, which bound what a kill loses; the time of the check is stored as that of receipt
RECEIVING = 0.01  # s that Zenoh's thread has for receiving the messages that wait
TOGETHER = 32_768  # bytes for which it is woken in between; to be woken for every message took two thirds of its time
FEW = 100  # messages between two checks, up to which it is woken for each
RETRY_PERIOD = 2.0  # s after which a recording that failed, as on a full disk, is tried again
CAPACITY, LOCKED_CAPACITY = 5000, 20_000  # messages that wait of a stream of PER_TICK, live and in lockstep; of more the oldest are lost
OTHER_CAPACITY, OTHER_LOCKED_CAPACITY = 1000, 2000  # the same for each of the other streams
KNOWN = 5000  # keys and senders that are remembered; a sender may invent more
TIDY_PERIOD = 10.0  # s between two returns of free memory: a flood of messages leaves 100 MB of it
NICENESS = 10
ALIVE, JSON = "alive", "json"  # key and encoding of the liveliness tokens, which are no messages on the bus
MOST_LOST = 2**53  # messages; a forged number may be any
_MEGABYTE = 1_000_000


class _Header(Struct):
    """The sender of a message, and its number."""

    src: str = ""
    seq: Count = 0


_header = msgspec.msgpack.Decoder(_Header)


def sender_of(payload: bytes) -> tuple[str, int] | None:
    """Return the name of the sender and the sequence number in the header of a message (`payload`); None if the header cannot be decoded.

    The recorder also records messages whose header cannot be decoded.
    """
    try:
        header = _header.decode(payload)
    except UNDECODABLE:
        return None
    return header.src, header.seq


FOR_SUBSCRIBERS: tuple[type[Message], ...] = (Clock, State, Pose, Contacts, Image, Camera)
"""Types of the streams that are published only if someone subscribes. Their content follows from the ticks and the robot's world."""

PER_TICK: tuple[type[Message], ...] = (
    Clock, Tick, State, Command, Commands, Motion, Follow, Reach, Targets, Pose, Forces, Contacts, Truth,
)  # fmt: skip
"""Types of the streams that may have a message in every tick."""


def queues(everything: bool, locked: bool) -> dict[str, int]:
    """Return the key expressions of the streams to record, each with the number of messages that may wait in its queue.

    `everything`: also the streams that are published only while they have a subscriber (FOR_SUBSCRIBERS). `locked`: whether the run is in
    lockstep, in which the queues are longer. Streams with few messages get short queues. The reason: each place in a queue takes 0.25 kB of
    memory from its first use on. A stream with few messages would need hours to use all places of a long queue, and the recorder's memory
    would grow during this time.
    """
    most, others = (LOCKED_CAPACITY, OTHER_LOCKED_CAPACITY) if locked else (CAPACITY, OTHER_CAPACITY)
    recorded = (cls for cls in streams() if everything or cls not in FOR_SUBSCRIBERS)
    return {cls.stream.keys(): most if cls in PER_TICK else others for cls in recorded}


def frequent_keys(parts: Iterable[str], everything: bool) -> list[str]:
    """Return the keys of the streams that have one key for each part, such as "{part}/motion", and may have a message in every tick.

    The key of the model's forces, "model/forces", is also among them. `parts`: parts of the robot. `everything`: also the streams that are
    published only while they have a subscriber (FOR_SUBSCRIBERS).
    """
    recorded = (cls for cls in PER_TICK if cls.stream.variable and (everything or cls not in FOR_SUBSCRIBERS))
    return [cls.stream.key(name) for cls in recorded for name in (("model",) if cls is Forces else parts)]


class RecorderNode:
    """Writes all messages unchanged, and copies of some of them, in JSON or as ROS 2 messages, for viewers."""

    def __init__(self, service: Service, config: Config, robot: Robot, settings: Mapping[str, bytes] | None = None) -> None:
        """Begin to record. `settings`: content of the settings files of the services, by name; None: those in the folder of the run."""
        self._service, self._folder, self._keep_free = service, Path(config.run_dir), int(config.keep_free * _MEGABYTE)
        settings = _settings_in(self._folder) if settings is None else settings
        self._files = Files(self._folder, int(config.largest * _MEGABYTE), settings)
        self._views = Views(robot, config.pose_rate, config.json_rate)
        self._channels: dict[tuple[str, str], tuple[Channel, str]] = {}  # of a key and an encoding, with the type of the messages
        self._kinds = {encoding_of(cls): cls.__name__ for cls in streams()}
        self._tokens: list[Raw] = []
        self._messages = self._lost = 0
        self._failed_at = 0.0  # monotonic clock
        self._trouble = ""
        self._last: dict[tuple[str, str], int] = {}  # number of the last message of each key and sender
        self._tap = Tap(service.bus.session, queues(config.everything, service.locked), frequent_keys(robot.parts, config.everything))
        service.describe, service.mark = self._describe, self._mark
        self._mark()
        service.on_alive(self._note_token)
        self._tidy()
        self._repeat()

    def lower_priority(self) -> None:
        """Lower the priority of the main thread below all services.

        Call this only after the recorder is ready: other services wait for its start, so the start must be fast. In lockstep the priority
        is not changed, for two reasons: no tick can be late, and a lost message would make it impossible to play the run again.
        """
        if self._service.locked:
            return
        os.nice(max(0, NICENESS - os.getpriority(os.PRIO_PROCESS, 0)))
        if hasattr(os, "SCHED_BATCH"):  # Linux: when it wakes, it preempts no other process
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))

    def end(self) -> None:
        """Write the messages that have arrived, and the index, to the file of the recording."""
        self._receive_all()
        time.sleep(RECEIVING)
        try:
            self._write(self._arrived())
            self._files.close()
        except OSError as error:
            self._service.log.error("the end of the recording is not written: %s", error.strerror)

    def _repeat(self) -> None:
        """Receive the messages that wait, and record them a moment later."""
        now = time.monotonic()
        self._receive_all()
        self._service.inbox.at(now + RECEIVING, self._record_arrived)
        self._service.inbox.at(now + PERIOD, self._repeat)

    def _receive_all(self) -> None:
        receive_together(self._sockets, 1)

    def _tidy(self) -> None:
        """Return free memory to the system, and list the TCP sockets to the router again: after a cut of the network they are new ones."""
        return_free_memory()
        self._sockets = sockets_at(self._service.config.endpoint)
        self._service.inbox.at(time.monotonic() + TIDY_PERIOD, self._tidy)

    def _record_arrived(self) -> None:
        arrived, now = self._arrived(), time.monotonic()
        if len(arrived) > FEW:  # otherwise it is woken seldom, and its connection must not seem dead if this thread is late
            receive_together(self._sockets, TOGETHER)
        if self._trouble and now < self._failed_at + RETRY_PERIOD:
            self._lost += len(arrived)
            return
        try:
            self._require_space()
            self._write(arrived)
        except OSError as error:
            self._lost += len(arrived)
            self._fail(f"nothing is recorded: {error.strerror or error}")
            return
        if self._trouble:
            self._service.bus.event("info", "recording", f"recording again; {self._lost} messages were lost")
            self._trouble = ""

    def _require_space(self) -> None:
        free = shutil.disk_usage(self._folder).free
        if free < self._keep_free:
            raise OSError(f"{self._folder} has {free / _MEGABYTE:.0f} MB left, and keep_free is {self._keep_free / _MEGABYTE:.0f}")

    def _fail(self, trouble: str) -> None:
        self._failed_at = time.monotonic()
        if trouble.partition(":")[0] != self._trouble.partition(":")[0]:
            self._service.bus.event("warning", "recording", trouble)
        self._trouble = trouble

    def _arrived(self) -> list[tuple[Raw, int]]:
        """Return the messages that have arrived, with their numbers.

        The numbers are read from the messages that are dropped, too: else the next message would count these as lost once more.
        """
        return [(message, self._number_of(message)) for message in self._tap.drain()]

    def _write(self, arrived: list[tuple[Raw, int]]) -> None:
        if self._tokens:
            arrived = sorted([*((token, 0) for token in self._tokens), *arrived], key=lambda one: one[0].published)
            self._tokens = []
        write, views = self._files.write, self._views
        for message, sequence in arrived:
            channel, kind = self._channels.get((message.key, message.encoding)) or self._new_channel(message)
            write(channel, message.payload, message.received, message.published, sequence)
            if kind:
                try:
                    copies = list(views.of(message, kind))
                except Exception as error:  # as in Bus.guarded: no message may end the recording of the others
                    self._service.bus.report_defect(f"{message.key}, for a copy that viewers show,", error)
                    continue
                for copy, data in copies:
                    write(copy, data, message.received, message.published, sequence)
        self._files.flush()
        self._messages += len(arrived)

    def _number_of(self, message: Raw) -> int:
        """Return the sequence number that the sender gave to a message, modulo 2^32; 0 if it has none, or the message is of no known type.

        If numbers are missing since the last message of this sender and key, these messages count as lost.
        """
        sender = sender_of(message.payload) if message.encoding in self._kinds else None
        if sender is None:
            return 0
        src, seq = sender
        stream = message.key, src
        if len(self._last) >= KNOWN:
            self._last.clear()
        last, self._last[stream] = self._last.get(stream, -1), seq
        if 0 <= last < seq - 1:
            self._lost = min(self._lost + seq - 1 - last, MOST_LOST)
        return seq & 0xFFFFFFFF

    def _new_channel(self, message: Raw) -> tuple[Channel, str]:
        """Return the channel of the key and encoding of a message, and the name of its message type; "" if no type has this encoding."""
        if len(self._channels) >= KNOWN:
            self._channels.clear()
        kind = self._kinds.get(message.encoding, "")
        encoding = "msgpack" if message.encoding.startswith("application/msgpack") else message.encoding
        found = self._channels[message.key, message.encoding] = Channel(message.key, encoding, message.encoding), kind
        return found

    def _note_token(self, who: str, instance: str, up: bool) -> None:
        content = json.dumps({"who": who, "instance": instance, "up": up}).encode()
        now = time.time_ns()
        self._tokens.append(Raw(ALIVE, JSON, content, now, now))

    def _mark(self) -> None:
        """Measure from now on the share of a processor that this process takes."""
        self._marked = time.monotonic(), time.process_time()

    def _describe(self) -> tuple[str, Mapping[str, float]]:
        passed, worked = (now - then for now, then in zip((time.monotonic(), time.process_time()), self._marked, strict=True))
        numbers = {"messages": self._messages, "lost": self._lost, "megabytes": self._files.size / _MEGABYTE, "files": self._files.begun}
        numbers["cpu_percent"] = 100.0 * worked / max(passed, 1e-3)
        lost = f", {self._lost} messages lost" if self._lost else ""
        return self._trouble or f"{self._messages} messages, {numbers['megabytes']:.1f} MB{lost}", numbers


def _settings_in(folder: Path) -> dict[str, bytes]:
    """Return the settings files of a run, with which a recording can be played again."""
    return {path.name: path.read_bytes() for path in sorted(folder.glob("*.toml"))}
