# SPDX-License-Identifier: Apache-2.0
"""Typed streams on a session: headers of sent messages, checks of received ones, counts of refused ones.

Each stream has a delivery class, which determines how its messages are queued, dropped and prioritised (bus_schema/stream.py).
"""

from __future__ import annotations

import logging
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import zenoh
import zenoh.ext
from zenoh.handlers import Callback, RingChannel

from bus_schema import VERSION, Refused, decode, encode, encoding_of
from bus_schema.messages import Clock, Event, Message, Tick, Turn
from bus_schema.stream import Delivery
from mobee.errors import MobeeError


@dataclass(frozen=True, slots=True)
class _Settings:
    """Zenoh's settings of a delivery class.

    `history`: number of past messages that a late subscriber gets.  `express`: each message is sent by itself, at once; a burst of them
    overflows Zenoh's queue of two and is lost.
    """

    congestion: zenoh.CongestionControl
    priority: zenoh.Priority
    history: int = 0
    express: bool = False


_DROP, _BLOCK = zenoh.CongestionControl.DROP, zenoh.CongestionControl.BLOCK

_SETTINGS: dict[Delivery, _Settings] = {  # the classes are described in bus_schema/stream.py
    "STOP": _Settings(_DROP, zenoh.Priority.REAL_TIME, express=True),  # alone with this priority, so that no other stream is before it
    "LATEST": _Settings(_DROP, zenoh.Priority.INTERACTIVE_HIGH),
    "STEP": _Settings(_BLOCK, zenoh.Priority.INTERACTIVE_HIGH),
    "DATA": _Settings(_DROP, zenoh.Priority.DATA),
    "BULK": _Settings(_DROP, zenoh.Priority.DATA_LOW),
    "EVENTS": _Settings(_DROP, zenoh.Priority.DATA_LOW, history=100),
    "NEWEST": _Settings(_DROP, zenoh.Priority.DATA_LOW, history=1),
}


_M = TypeVar("_M", bound=Message)
NO_RUN = "-"  # before the first clock message


class Publisher(Generic[_M]):
    """Publishes the messages of one stream, with a header and sequence numbers."""

    def __init__(self, bus: Bus, key: str, cls: type[_M], delivery: Delivery) -> None:
        self._bus, self._cls, self._seq = bus, cls, 0
        self._has_subscribers: bool | None = None  # None: not requested yet
        self._key = key.encode()
        how = _SETTINGS[bus.control if delivery == "CONTROL" else delivery]
        settings: dict[str, Any] = {
            "encoding": encoding_of(cls),
            "congestion_control": how.congestion,
            "priority": how.priority,
            "express": how.express,
        }
        if how.history:
            cache = zenoh.ext.CacheConfig(max_samples=how.history)
            self._publisher: Any = zenoh.ext.declare_advanced_publisher(bus.session, key, cache=cache, publisher_detection=True, **settings)
        else:
            self._publisher = bus.session.declare_publisher(key, **settings)

    def put(self, *, k: int | None = None, t: int | None = None, **fields: Any) -> None:
        """Publish one message with the fields `fields`; the header is filled in.

        `k`, `t`: tick and time [ns] of the message; None: those of the bus clock.
        """
        bus = self._bus
        message = self._cls(
            v=VERSION,
            run=bus.run,
            src=bus.who,
            seq=self._seq,
            k=bus.k if k is None else k,
            t=bus.t if t is None else t,
            tw=time.monotonic_ns(),
            **fields,
        )
        self._seq += 1
        self._publisher.put(encode(message), attachment=self._key)

    @property
    def has_subscribers(self) -> bool:
        """Whether there is a subscriber; without one, an expensive message need not be made."""
        if self._has_subscribers is None:
            self._publisher.declare_matching_listener(Callback(self._note_matching, indirect=False))
            self._has_subscribers = bool(self._publisher.matching_status.matching)
        return self._has_subscribers

    def _note_matching(self, status: zenoh.MatchingStatus) -> None:
        """Store whether there is a subscriber; Zenoh's thread calls it, which takes much less time than a query in every tick."""
        self._has_subscribers = bool(status.matching)


class Latest(Generic[_M]):
    """Stores the newest message of a stream until it is read; older ones are overwritten, never queued.

    `part`: the part whose number of motors the vectors in the messages must have; None: the lengths are not checked.
    """

    def __init__(self, bus: Bus, key: str, cls: type[_M], part: str | None) -> None:
        self._bus, self._cls, self._part = bus, cls, part
        self._subscriber = bus.session.declare_subscriber(key, RingChannel(1))

    def take(self) -> _M | None:
        """Return the newest message since the last call; None if no message has arrived, or if the newest one is refused."""
        sample = self._subscriber.try_recv()
        return None if sample is None else self._bus.receive(self._cls, sample, self._part)


def part_of(cls: type[Message], name: str) -> str | None:
    """Return the part whose number of motors the vectors in messages of the type `cls` must have; None: the lengths are not checked.

    `name`: the text that stands for the variable in the key of the messages. If this variable is the part, as in "{part}/motion", the
    result is `name`. If `name` is "*" (any part), or the key has another variable or none, the result is None.
    """
    return name if cls.stream.variable == "part" and name != "*" else None


def other_key(received: zenoh.Sample | zenoh.Query) -> str:
    """Return the key under which a message or call was sent, if it differs from the key under which it arrived; otherwise an empty text.

    `received`: the message or call, as Zenoh has delivered it. Zenoh transmits numbers that stand for keys. Just after a connection was
    replaced by a new one, such a number can stand for a wrong key. Each sender therefore attaches the true key to the message. If no key is
    attached, the result is an empty text; if the attached key is empty, the result is "nothing".
    """
    attached = received.attachment
    if attached is None or (sent := attached.to_bytes()) == str(received.key_expr).encode():
        return ""
    return sent[:200].decode(errors="replace") or "nothing"


def require_key(received: zenoh.Sample | zenoh.Query) -> None:
    """Raise Refused if a message or call has arrived under another key than the one that its sender has attached.

    `received`: the message or call, as Zenoh has delivered it.
    """
    if sent := other_key(received):
        raise Refused("key", f"sent as {sent}")


class Bus:
    """The connection of a process with the bus: its session, the newest tick and time, and the counts of refused messages.

    `who`: name of the service, which its messages contain as `src`.
    """

    def __init__(self, session: zenoh.Session, who: str, log: logging.Logger) -> None:
        self.session, self.who, self.log = session, who, log
        self.run, self.k, self.t = NO_RUN, 0, 0
        self.dt = 0  # ns a tick
        self._speed, self._ticked = 0.0, 0.0  # simulated seconds a second, 0 in lockstep; monotonic clock, when `t` was noted
        self.part_sizes: dict[str, int] = {}
        self.robot_size: int | None = None
        self.rejected: Counter[str] = Counter()
        self.control: Delivery = "LATEST"  # delivery class of CONTROL streams: STEP in lockstep
        self._reported: dict[str, float] = {}
        self._events: Publisher[Event] = self.publisher(Event, who)

    def note_time(self, message: Clock | Turn) -> None:
        """Set tick, time and tick length of the bus clock to those of a message."""
        self.k, self.t, self.dt = message.k, message.t, message.dt
        self._speed = message.rate if isinstance(message, Clock) and message.mode == "free" else 0.0
        self._ticked = time.monotonic()

    def now(self) -> int:
        """Return the present time of the bus clock, ns.

        In free mode the time since the newest tick is added, so that the result is right also in the middle of a tick or of a long
        computation. In lockstep (every tick waits for all participants) it is the time of the newest tick.
        """
        return self.t + round(1e9 * self._speed * (time.monotonic() - self._ticked))

    def publisher(self, cls: type[_M], name: str = "", delivery: Delivery | None = None) -> Publisher[_M]:
        """Return a publisher of a stream.

        Args:
            cls: type of the messages; its `stream` contains key and delivery class.
            name: value of the variable in the stream's key, such as the name of the part; empty: the key has no variable.
            delivery: delivery class of the stream (how messages are queued, dropped and prioritised); None: that of the type `cls`.
        """
        return Publisher(self, cls.stream.key(name), cls, delivery or cls.stream.delivery)

    def latest(self, cls: type[_M], name: str = "*") -> Latest[_M]:
        """Return an object that stores the newest message of a stream.

        `name`: value of the variable in the stream's key, such as the name of the part. By default the object accepts messages with any
        value.
        """
        return Latest(self, cls.stream.keys(name), cls, part_of(cls, name))

    def receive(self, cls: type[_M], sample: zenoh.Sample, part: str | None = None, *, any_run: bool = False) -> _M | None:
        """Return the message of the type `cls` in a sample (the received bytes and their key); None if it is refused.

        A refusal is counted and published as a warning.

        `part`: the part whose number of motors the vectors must have; None: not checked. `any_run`: accept also a message of another run of
        robot_sim. Before the first clock message the run is not known: without `any_run` the result is then None, and nothing is counted.
        """
        if self.run == NO_RUN and not any_run:
            return None
        try:
            require_key(sample)
            size = None if part is None else self.part_sizes[part]
            message = decode(cls, sample.payload.to_bytes(), str(sample.encoding), part=size, robot=self.robot_size)
            if not any_run and message.run != self.run:
                raise Refused("run", f"{cls.__name__} of run {message.run}, the present run is {self.run}")
            if isinstance(message, Tick) and self.part_sizes and message.parts.keys() != self.part_sizes.keys():
                raise Refused("part", f"Tick with the parts {', '.join(message.parts)}; this robot has {', '.join(self.part_sizes)}")
        except Refused as refused:
            self.reject(refused.reason, f"{sample.key_expr}: {refused}")
            return None
        return message

    def reject(self, reason: str, text: str) -> None:
        """Count a refused message or call under `reason`, and publish `text` as a warning, at most once per second for each reason."""
        self.rejected[reason] += 1
        now = time.monotonic()
        if now - self._reported.get(reason, -1.0) >= 1.0:
            self._reported[reason] = now
            self.event("warning", "refused", text, times=float(self.rejected[reason]))

    def guarded(self, what: str, handle: Callable[[], object]) -> None:
        """Run `handle`; if it raises an unexpected exception, count and log it, publish a warning, and let the process continue.

        `what`: name of the stream or call, for the report. A MobeeError is not caught: it ends the process.
        """
        try:
            handle()
        except MobeeError:
            raise
        except Exception as error:  # any: no message may end a process, and the report names the exception
            self.report_defect(what, error)

    def report_defect(self, what: str, error: Exception) -> str:
        """Count and log a failed handler of a stream or call, and publish a warning; return the text of the report.

        `what`: name of the stream or call. `error`: the exception that the handler has raised.
        """
        text = f"the handler of {what} failed: {type(error).__name__}: {error}"
        self.log.error("%s", text, exc_info=error)
        self.reject("handler", text)
        return text

    def event(self, level: str, code: str, text: str, **values: float) -> None:
        """Report an event to the user: on the bus and in the log.

        `level`: info, warning or error. `code`: short name of the kind of event. `values`: numbers that belong to the event.
        """
        self.log.log({"info": 20, "warning": 30, "error": 40}[level], "%s: %s", code, text)
        self._events.put(level=level, code=code, text=text[:2000], values=values)
