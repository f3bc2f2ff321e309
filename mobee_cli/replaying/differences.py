# SPDX-License-Identifier: Apache-2.0
"""Finds where two runs diverge: the first tick, key and field in which their messages differ."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec

from bus_schema.page import streams
from mobee.errors import MobeeError
from mobee_cli.replaying.ticks import Item, TickOf, ticks
from services.recorder.reader import Recording

OF_THE_RUN = frozenset(("run", "seq", "tw"))  # fields that differ between two runs that do the same
_NAMES = frozenset(("epoch", "action_id", "cmd_seq"))  # drawn or counted anew in every run
_ORDER = ("Tick", "Targets", "Forces", "Motion", "Reach", "Commands", "Command")  # of cause and effect in a tick
_REPEATABLE = ("CONTROL", "STEP")  # delivery classes of the messages that two equal runs in lockstep have in common
_LEFT_OUT = ("Clock", "StepDone", "Turn", "Served", "State")  # of them, those that others' joining or reading changes


@dataclass(frozen=True, slots=True)
class Difference:
    """The first difference between two messages with the same key and tick.

    `field`: path of the field in the message, such as "q[3]"; "message" if one recording does not contain the message. `first`, `second`:
    value of the field in each recording; the text "missing" if that recording does not contain the message or field. If the recordings
    do not have the same ticks, `key` is "tick", `field` is "k", and `first` and `second` are the indices of the ticks that each has there.
    """

    tick: int
    key: str
    field: str
    first: Any
    second: Any

    def __str__(self) -> str:
        return f"tick {self.tick}, {self.key}, {self.field}: {_short(self.first)} and {_short(self.second)}"


MISSING = "missing"


def difference(tick: int, key: str, first: Any, second: Any, ignored: Collection[str] = ()) -> Difference | None:
    """Compare the messages `first` and `second`, to the last bit, and return the first field in which they differ; None if they are equal.

    `tick`, `key`: stored in the result. `ignored`: names of fields that may differ.
    """
    found = _differing(first, second, ignored, "")
    return None if found is None else Difference(tick, key, *found)


def _differing(first: Any, second: Any, ignored: Collection[str], place: str) -> tuple[str, Any, Any] | None:
    if isinstance(first, Mapping) and isinstance(second, Mapping):
        for name in [*first, *(name for name in second if name not in first)]:
            if name not in ignored:
                inner = _differing(first.get(name, MISSING), second.get(name, MISSING), ignored, f"{place}.{name}".lstrip("."))
                if inner:
                    return inner
        return None
    if isinstance(first, list) and isinstance(second, list):
        for index in range(max(len(first), len(second))):
            one, other = (side[index] if index < len(side) else MISSING for side in (first, second))
            inner = _differing(one, other, ignored, f"{place}[{index}]")
            if inner:
                return inner
        return None
    equal = type(first) is type(second) and msgspec.msgpack.encode(first) == msgspec.msgpack.encode(second)  # -0.0 is not 0.0
    return None if equal else (place or "message", first, second)


def compare(tick: int, first: Sequence[Item], second: Sequence[Item], ignored: Collection[str]) -> Difference | None:
    """Return the first difference between `first` and `second`, lists of the messages of one tick; None if there is none.

    The messages are compared key by key, in the order in which the control loop publishes them. `ignored`: names of fields that may differ.
    """
    sides = [_by_key(first), _by_key(second)]
    keys = sorted({*sides[0], *sides[1]}, key=lambda key: (_rank(next(side[key][0].type for side in sides if key in side)), key))
    for key in keys:
        lists = [side.get(key, []) for side in sides]
        for index in range(max(map(len, lists))):
            one, other = (items[index].content() if index < len(items) else MISSING for items in lists)
            found = difference(tick, key, one, other, ignored)
            if found:
                return found
    return None


def _by_key(items: Sequence[Item]) -> dict[str, list[Item]]:
    found: dict[str, list[Item]] = {}
    for item in items:
        found.setdefault(item.key, []).append(item)
    return found


def _rank(kind: str) -> int:
    return _ORDER.index(kind) if kind in _ORDER else len(_ORDER)


@dataclass(frozen=True, slots=True)
class Compared:
    """The result of the comparison of two recordings.

    `ticks`, `messages`: numbers of equal ticks and messages. `difference`: the first difference; None: the recordings are equal as far as
    both reach. `ends`: the recording that ends first ("first" or "second"); empty: both end at the same tick, or they differ.
    """

    ticks: int
    messages: int
    difference: Difference | None
    ends: str


def compare_runs(first: Recording, second: Recording) -> Compared:
    """Compare the control messages of two runs from tick 1, up to the first difference or the end of one recording.

    Tick 0 is not compared, because it is repeated until all services have started. Raises MobeeError if a recording has no complete tick
    after tick 0.
    """
    kinds = {cls.__name__ for cls in streams() if cls.stream.delivery in _REPEATABLE} - set(_LEFT_OUT)
    counted = messages = 0
    sides = [_from_tick_1(ticks(first)), _from_tick_1(ticks(second))]
    while True:
        one, other = (next(side, None) for side in sides)
        if one is None or other is None:
            if not counted:
                raise MobeeError("nothing was compared: a recording has no whole tick after tick 0")
            return Compared(counted, messages, None, "" if one is other else "first" if one is None else "second")
        if one.k != other.k:
            return Compared(counted, messages, Difference(min(one.k, other.k), "tick", "k", one.k, other.k), "")
        here, there = ([item for item in tick.items if item.type in kinds] for tick in (one, other))
        found = compare(one.k, here, there, OF_THE_RUN | _NAMES)
        if found:
            return Compared(counted, messages, found, "")
        counted, messages = counted + 1, messages + len(here)


def _from_tick_1(all_ticks: Iterator[TickOf]) -> Iterator[TickOf]:
    return (tick for tick in all_ticks if tick.k > 0)


def _short(value: Any) -> str:
    text = value if value == MISSING else repr(value)
    return text if len(text) <= 60 else f"{text[:56]} ..."
