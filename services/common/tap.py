# SPDX-License-Identifier: Apache-2.0
"""Receives, publishes, answers and calls with messages of any type as bytes, for programs that record them and play them again."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import zenoh
from msgspec import Struct
from zenoh.handlers import Callback, RingChannel

from bus_schema import type_of
from services.common.bus import other_key
from services.common.listener import stay_known


class Raw(Struct, frozen=True, gc=False):
    """A message as it is on the bus, and in a recording; times in ns since 1970."""

    key: str
    encoding: str
    payload: bytes
    received: int
    published: int  # by the sender's clock

    @property
    def type(self) -> str:
        """The name of the message's type; "" for data that are no message of the contract, such as a recorded liveliness token."""
        return type_of(self.encoding)


class Tap:
    """The messages of some keys.

    Zenoh's thread stores them without Python, so that this process, however slowly it runs, delays no sender; of more messages than may
    wait the oldest are lost.
    """

    def __init__(self, session: zenoh.Session, queues: Mapping[str, int], frequent: Iterable[str]) -> None:
        """Subscribe.

        `queues`: how many messages of each key expression may wait.  `frequent`: keys with many messages that only expressions with
        wildcards contain.  Zenoh stores the route of a key that is subscribed itself; for any other key each message is compared with all
        subscriptions, which took a third of the receiving thread's time.
        """
        self._streams = [(key, session.declare_subscriber(key, RingChannel(capacity))) for key, capacity in queues.items()]
        self._routes = [session.declare_subscriber(key, RingChannel(1)) for key in frequent]  # never read

    def drain(self) -> list[Raw]:
        """Return the messages that have arrived since the last call, in the order of their times of publication."""
        arrived, now = [], time.time_ns()
        for key, stream in self._streams:
            while (sample := stream.try_recv()) is not None:
                if not other_key(sample):
                    found = str(sample.key_expr) if "*" in key else key
                    arrived.append(Raw(found, str(sample.encoding), sample.payload.to_bytes(), now, _published(sample, now)))
        arrived.sort(key=lambda message: message.published)
        return arrived


def _published(sample: zenoh.Sample, otherwise: int) -> int:
    """Return the time of a sample, ns since 1970."""
    return otherwise if sample.timestamp is None else int(sample.timestamp.get_time_as_ntp64().as_nanos())


class RawPublisher:
    """Publishes messages as they were recorded, on any key: every one, in order."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._publishers: dict[str, zenoh.Publisher] = {}

    def put(self, key: str, encoding: str, payload: bytes) -> None:
        """Publish one message."""
        publisher = self._publishers.get(key)
        if publisher is None:
            publisher = self._publishers[key] = self._session.declare_publisher(
                key, congestion_control=zenoh.CongestionControl.BLOCK, priority=zenoh.Priority.REAL_TIME
            )
        publisher.put(payload, encoding=encoding)


def receive_raw(session: zenoh.Session, key: str, handle: Callable[[Raw], None]) -> Any:
    """Handle every message of other processes on a key expression, in the thread that has received it; returns the subscription."""

    def read(sample: zenoh.Sample) -> None:
        now = time.time_ns()
        handle(Raw(str(sample.key_expr), str(sample.encoding), sample.payload.to_bytes(), now, _published(sample, now)))

    return session.declare_subscriber(key, Callback(stay_known(read), indirect=False), allowed_origin=zenoh.Locality.REMOTE)


def answer_raw(session: zenoh.Session, key: str, answer: Callable[[str, bytes], tuple[str, bytes] | None]) -> Any:
    """Answer calls on a key expression with an encoding and bytes, or not at all; returns the queryable.

    `answer`: called with the key and the request, in a thread of Zenoh.
    """

    def reply(query: zenoh.Query) -> None:
        with query:
            found = answer(str(query.key_expr), b"" if query.payload is None else query.payload.to_bytes())
            if found is not None:
                query.reply(query.key_expr, found[1], encoding=found[0])

    return session.declare_queryable(key, reply)


def call_raw(session: zenoh.Session, key: str, encoding: str, request: bytes, timeout: float) -> tuple[str, bytes] | None:
    """Make a call with a request as it was recorded; return encoding and bytes of the answer, also of a refusal; None if there is none."""
    for reply in session.get(key, payload=request, encoding=encoding, timeout=timeout):
        found = reply.ok or reply.err
        if found is not None:
            return str(found.encoding), found.payload.to_bytes()
    return None
