# SPDX-License-Identifier: Apache-2.0
"""Access to the bus for programs that record messages and replay them.

Messages of any type are received and published as bytes, and so are calls and their replies.
"""

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
    """A message of any type as bytes, as it is on the bus and in a recording.

    `encoding`: its encoding string. `received`: time at which this process received it, ns since 1970. `published`: time of publication by
    the sender's clock, ns since 1970.
    """

    key: str
    encoding: str
    payload: bytes
    received: int
    published: int

    @property
    def type(self) -> str:
        """The name of the message's type, such as State.

        Empty for data that have no message type of this project, such as a recorded liveliness token.
        """
        return type_of(self.encoding)


class Tap:
    """Receives the messages of some keys as bytes.

    Zenoh's thread stores the messages without running Python. A slow process therefore delays no sender. If more messages wait than a queue
    can hold, the oldest are lost.
    """

    def __init__(self, session: zenoh.Session, queues: Mapping[str, int], frequent: Iterable[str]) -> None:
        """Subscribe to all key expressions in `queues`.

        `queues`: number of messages that may wait, by key expression. `frequent`: keys with many messages, if `queues` does not contain the
        key itself, but only an expression with wildcards that matches it. These keys are subscribed to also, which saves time. For a key
        with a subscription of its own, Zenoh stores the route of the messages. Without one, it compares each message with all
        subscriptions, which took a third of the receiving thread's time.
        """
        self._streams = [(key, session.declare_subscriber(key, RingChannel(capacity))) for key, capacity in queues.items()]
        self._routes = [session.declare_subscriber(key, RingChannel(1)) for key in frequent]  # never read

    def drain(self) -> list[Raw]:
        """Return the messages that have arrived since the last call, sorted by the time of publication."""
        arrived, now = [], time.time_ns()
        for key, stream in self._streams:
            while (sample := stream.try_recv()) is not None:
                if not other_key(sample):
                    found = str(sample.key_expr) if "*" in key else key
                    arrived.append(Raw(found, str(sample.encoding), sample.payload.to_bytes(), now, _published(sample, now)))
        arrived.sort(key=lambda message: message.published)
        return arrived


def _published(sample: zenoh.Sample, otherwise: int) -> int:
    """Return the time at which a received message (sample) was sent, ns since 1970; `otherwise`: result if it has no time."""
    return otherwise if sample.timestamp is None else int(sample.timestamp.get_time_as_ntp64().as_nanos())


class RawPublisher:
    """Publishes messages unchanged, as they were recorded, on any key. All messages are sent, in order: a full queue blocks the caller."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._publishers: dict[str, zenoh.Publisher] = {}

    def put(self, key: str, encoding: str, payload: bytes) -> None:
        """Publish the bytes `payload` on `key`, with their encoding string."""
        publisher = self._publishers.get(key)
        if publisher is None:
            publisher = self._publishers[key] = self._session.declare_publisher(
                key, congestion_control=zenoh.CongestionControl.BLOCK, priority=zenoh.Priority.REAL_TIME
            )
        publisher.put(payload, encoding=encoding)


def receive_raw(session: zenoh.Session, key: str, handle: Callable[[Raw], None]) -> Any:
    """Call `handle` for every message of other processes on the key expression `key`; return the subscription.

    `handle` runs in the thread of Zenoh that has received the message.
    """

    def read(sample: zenoh.Sample) -> None:
        now = time.time_ns()
        handle(Raw(str(sample.key_expr), str(sample.encoding), sample.payload.to_bytes(), now, _published(sample, now)))

    return session.declare_subscriber(key, Callback(stay_known(read), indirect=False), allowed_origin=zenoh.Locality.REMOTE)


def answer_raw(session: zenoh.Session, key: str, answer: Callable[[str, bytes], tuple[str, bytes] | None]) -> Any:
    """Answer calls on the key expression `key` with bytes; return Zenoh's queryable, which ends when it is deleted.

    `answer(key, request)`: called in a thread of Zenoh with the key and the bytes of the request; returns the encoding string and the bytes
    of the reply, or None to send no reply.
    """

    def reply(query: zenoh.Query) -> None:
        with query:
            found = answer(str(query.key_expr), b"" if query.payload is None else query.payload.to_bytes())
            if found is not None:
                query.reply(query.key_expr, found[1], encoding=found[0])

    return session.declare_queryable(key, reply)


def call_raw(session: zenoh.Session, key: str, encoding: str, request: bytes, timeout: float) -> tuple[str, bytes] | None:
    """Call `key` with the bytes of a recorded request; return the encoding string and the bytes of the reply, or None if no reply comes.

    A refusal (`Failure`) is returned like any other reply. `encoding`: encoding string of the request. `timeout`: s.
    """
    for reply in session.get(key, payload=request, encoding=encoding, timeout=timeout):
        found = reply.ok or reply.err
        if found is not None:
            return str(found.encoding), found.payload.to_bytes()
    return None
