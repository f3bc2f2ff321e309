# SPDX-License-Identifier: Apache-2.0
"""The messages of a recorded run, tick by tick."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import msgspec
from msgspec import Struct

from bus_schema import UNDECODABLE
from bus_schema.messages import Served
from mobee.errors import MobeeError
from services.common.bus import NO_RUN
from services.common.tap import Raw
from services.recorder.reader import Recording

SLACK = 20  # ticks after which a message of a tick is no longer expected: in free mode streams of low priority arrive late


class _Header(Struct):
    run: str = ""
    src: str = ""
    k: int = -1


_header = msgspec.msgpack.Decoder(_Header)


@dataclass(frozen=True, slots=True)
class Item:
    """A recorded message, or a recorded change of a liveliness token (then `type` is empty).

    `src`: name of the sender; empty: not known.
    """

    message: Raw
    src: str

    @property
    def key(self) -> str:
        """The key of the message on the bus."""
        return self.message.key

    @property
    def type(self) -> str:
        """The name of the message's type, such as "Motion"; empty for a liveliness token."""
        return self.message.type

    def content(self) -> dict[str, Any]:
        """Return the fields of the message, by name. Raises MobeeError if the message cannot be decoded."""
        try:
            decode = msgspec.msgpack.decode if self.type else msgspec.json.decode
            return dict(decode(self.message.payload))
        except (*UNDECODABLE, TypeError) as error:
            raise MobeeError(f"a message on {self.key} cannot be read: {error}") from None


@dataclass(slots=True)
class TickOf:
    """All recorded messages of tick `k`, in the order in which the recorder received them."""

    k: int
    items: list[Item] = field(default_factory=list)

    def of(self, kind: str, src: str = "") -> list[Item]:
        """Return the messages of this tick that have the type `kind`.

        `src`: name of the sender; empty: messages of every sender are returned.
        """
        return [item for item in self.items if item.type == kind and src in ("", item.src)]


def ticks(recording: Recording) -> Iterator[TickOf]:
    """Yield the ticks of a recording, in order. Raises MobeeError if the recording contains no tick.

    If robot_sim was started again during the recording, only the ticks of its first run are yielded. Some messages belong to no run, such
    as a liveliness token or an emergency stop of a client; they are added to the newest tick that was recorded before them. The last tick
    is left out, because it may be incomplete.
    """
    run, newest, waiting = "", 0, {0: TickOf(0)}
    last = -1  # tick that was yielded
    for message in recording:
        header = _header_of(message)
        if message.type == "Tick":
            run = run or header.run
            if header.run != run:
                break
            newest = max(newest, header.k)
        elif header.run not in ("", NO_RUN, run):
            if run:
                continue  # of a run before or after
        k = header.k if header.run == run and run and header.k >= 0 else newest
        if k <= last:
            continue  # it arrived too late to be placed
        waiting.setdefault(k, TickOf(k)).items.append(Item(message, header.src))
        while waiting and (first := min(waiting)) < newest - SLACK:
            last = first
            yield waiting.pop(first)
    if not run:
        raise MobeeError("the recording holds no tick of a robot")
    for k in sorted(waiting):
        if k < newest:
            yield waiting[k]


def _header_of(message: Raw) -> _Header:
    if not message.type:
        return _Header()
    try:
        return _header.decode(message.payload)
    except UNDECODABLE:
        return _Header()


def served_of(message: Raw) -> Served | None:
    """Decode a message of type Served, which describes a call and its reply; return None if the message cannot be decoded."""
    try:
        return msgspec.msgpack.decode(message.payload, type=Served)
    except UNDECODABLE:
        return None
