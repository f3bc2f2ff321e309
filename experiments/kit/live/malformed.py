# SPDX-License-Identifier: Apache-2.0
"""Draws random messages, requests and liveliness tokens of the bus that are nearly valid, to test a live system with wrong input.

A liveliness token is a mark on the bus that disappears when its process dies; by it, other processes see that the process runs.  Keys and
fields are those of the bus.  Most values are valid; run, tick and time are mostly those of the running system, or near.  Some values are
extreme, odd or of a wrong length.  In some messages a field is left out, added or of another type.  In some the bytes are truncated, or one
byte is changed.  `python -m experiments.kit.live.malformed` sends them.
"""

from __future__ import annotations

import json
import random
import sys
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any

import msgspec
from msgspec import Struct
from msgspec.inspect import (
    BoolType,
    DictType,
    FloatType,
    IntType,
    ListType,
    LiteralType,
    Metadata,
    NoneType,
    StrType,
    StructType,
    Type,
    UnionType,
    type_info,
)

from bus_schema import VERSION, decode, encoding_of, keys
from bus_schema.codec import Refused
from bus_schema.messages import Tick
from bus_schema.page import streams
from bus_schema.rpc import CALLS
from services.common.observe import Received, listen
from services.common.session import open_client
from services.common.tap import RawPublisher

INVALID = 0.03  # share of values that are not valid
CHANGED = 0.05  # share of messages of which a field or a byte is changed
CALL, TOKEN = 0.05, 0.02  # shares of calls and of tokens among all that is sent
TIMEOUT = 0.5  # s that a call waits for its answers
ENDS = ("shutdown",)  # verbs of calls that end a process by intent: they are sent with invalid requests only
SERVICES = ("robot_sim", "model", "controller", "launcher", "agent_torso", "agent_left_arm", "agent_right_arm")
NAMES = (
    *SERVICES,
    "monitor",
    "nobody",
    "ball",
    "table",
    "reach_target",
    "right_palm",
    "left_palm",
    "head",
    "torso",
    "left_arm",
    "right_arm",
)
INSTANCES = 100  # among which tokens are drawn: Zenoh keeps a kilobyte of every key that was ever declared (zenoh#1518)
ODD_NAMES = ("", "*", "**", "a/b", "../..", "\x00", "ü", "x" * 64, "x" * 65, "x" * 5000, "$", "@", "-1", "None")
LENGTHS = (0, 1, 3, 4, 6, 7, 9, 16, 41, 1000)
INTEGERS = (0, 1, -1, 2**31, 2**53, 2**62, 2**63 - 1, -(2**63), 2**64 - 1)
FLOATS = (0.0, -0.0, 1.0, -1.0, 1e-300, 1e308, -1e308, float("inf"), float("-inf"), float("nan"))
OTHER: tuple[Any, ...] = (None, True, 0, -1, 1.5, "x", b"\x00", [], {}, [[[]]], {"": 0}, [None] * 10)


@dataclass(frozen=True, slots=True)
class Drawn:
    """A drawn message: key, payload and encoding; `call`: whether it is sent as a call, which has a reply."""

    key: str
    payload: bytes
    encoding: str
    call: bool


class Drawer:
    """Draws nearly valid messages, requests and liveliness tokens; the same seed gives the same ones.

    A liveliness token is a mark on the bus that disappears when its process dies.  `seed`: of the draws.  `parts`: number of motors of each
    part, by name.
    """

    def __init__(self, seed: int, parts: dict[str, int]) -> None:
        self._random = random.Random(seed)
        self._parts = parts
        self._streams = streams()
        self._calls = [(call.pattern, verb, call.request) for call in CALLS for verb in call.verbs or ("",)]
        self.run, self.k, self.t = "-", 0, 0  # of the newest tick

    def message(self) -> Drawn:
        """Draw a message of a stream of the bus; the stream is chosen at random."""
        cls = self._random.choice(self._streams)
        part = self._random.choice([*self._parts])
        name = {"part": part}.get(cls.stream.variable) or self._random.choice(NAMES)
        return self._drawn(cls.stream.key(name), cls, self._parts[part], call=False)

    def request(self) -> Drawn:
        """Draw the request of a random call (remote procedure) of the bus."""
        pattern, verb, cls = self._random.choice(self._calls)
        part = self._random.choice([*self._parts])
        key = pattern.replace("{verb}", verb).replace("{part}", part).replace("{service}", self._random.choice(SERVICES))
        return self._drawn(key, cls, self._parts[part], call=True, valid=verb not in ENDS)

    def token(self) -> str:
        """Draw the bus key of a liveliness token, which declares that a process runs: a service, the router or an unknown process."""
        who = self._random.choice((*SERVICES, "router", "stranger"))
        return keys.alive(who, f"i{self._random.randrange(INSTANCES)}")

    def _drawn(self, key: str, cls: type[Struct], size: int, call: bool, valid: bool = True) -> Drawn:
        fields = self._fields(_struct(cls), size)
        fields["v"] = VERSION if valid and self._random.random() > INVALID else self._random.choice((VERSION + 1, 0, -1))
        if "run" in fields and self._random.random() > INVALID:
            fields |= {"run": self.run, "k": max(0, self.k + self._random.randint(-3, 3)), "t": self.t, "tw": time.monotonic_ns()}
        if self._random.random() < CHANGED:
            self._change(fields)
        payload = msgspec.msgpack.encode(fields)
        if self._random.random() < CHANGED:
            payload = self._damaged(payload)
        encoding = encoding_of(cls if self._random.random() > INVALID else Tick)
        return Drawn(key, payload, encoding, call)

    def _fields(self, info: StructType, size: int) -> dict[str, Any]:
        return {field.encode_name: self._value(field.type, size) for field in info.fields}

    def _change(self, fields: dict[str, Any]) -> None:
        name = self._random.choice([*fields])
        match self._random.randrange(3):
            case 0:
                del fields[name]
            case 1:
                fields[name] = self._random.choice(OTHER)
            case 2:
                fields[self._random.choice(NAMES)] = self._random.choice(OTHER)

    def _damaged(self, payload: bytes) -> bytes:
        at = self._random.randrange(len(payload))
        if self._random.random() < 0.5:
            return payload[:at]
        return payload[:at] + self._random.randbytes(1) + payload[at + 1 :]

    def _value(self, info: Type, size: int) -> Any:
        draw, odd = self._random, self._random.random() < INVALID
        match info:
            case Metadata(type=inner, extra=extra):
                if extra and "length" in extra and not odd:
                    return [draw.gauss(0.0, 0.5) for _ in range(size if extra["length"] == "part" else sum(self._parts.values()))]
                return self._value(inner, size)
            case IntType(ge=low, le=high, gt=above):
                least = low if low is not None else 0 if above is None else above + 1
                return draw.choice(INTEGERS) if odd else draw.randint(least, min(high if high is not None else 10**9, least + 10**9))
            case FloatType(ge=low, le=high, gt=above):
                bottom = low if low is not None else above
                within = draw.gauss(0.0, 0.5) if bottom is None else bottom + 1e-3 + draw.random() * ((high or 1.0) - bottom - 1e-3)
                return draw.choice(FLOATS) if odd else within
            case StrType():
                return draw.choice(ODD_NAMES if odd else NAMES)
            case ListType(item_type=item, min_length=least, max_length=most):
                length = draw.choice(LENGTHS) if odd else draw.randint(least or 0, min(most or 4, (least or 0) + 4))
                return [self._value(item, size) for _ in range(length)]
            case DictType(value_type=item):
                return {draw.choice(NAMES): self._value(item, size) for _ in range(draw.choice(LENGTHS[:4]))}
            case LiteralType(values=values):
                return draw.choice(OTHER) if odd else draw.choice(values)
            case StructType():
                return self._fields(info, size)
            case UnionType(types=types):
                return self._value(draw.choice(types), size)
            case BoolType():
                return draw.random() < 0.5
            case NoneType():
                return None
        return draw.randbytes(draw.choice(LENGTHS))


def send(endpoint: str, seed: int, count: int, parts: dict[str, int]) -> Counter[str]:
    """Send `count` drawn messages, requests and tokens to a running system; returns how many were sent: "messages", "calls", "tokens".

    `endpoint`: address of the router.  `seed`: seed by which they are drawn.  `parts`: number of motors of each part, by name.
    """
    drawer, draw, sent = Drawer(seed, parts), random.Random(seed), Counter[str]()
    with open_client(endpoint) as session:
        liveliness: Any = session.liveliness()
        publisher = RawPublisher(session)

        def note(received: Received) -> None:
            with suppress(Refused):  # a drawn one
                tick = decode(Tick, received.payload, received.encoding)
                drawer.run, drawer.k, drawer.t = tick.run, tick.k, tick.t

        listen(session, Tick.stream.key(), note)
        for _ in range(count):
            kind = draw.random()
            if kind < TOKEN:
                liveliness.declare_token(drawer.token()).undeclare()
                sent["tokens"] += 1
                continue
            drawn = drawer.request() if kind < TOKEN + CALL else drawer.message()
            if drawn.call:
                session.get(drawn.key, lambda _: None, payload=drawn.payload, encoding=drawn.encoding, timeout=TIMEOUT)
            else:
                publisher.put(drawn.key, drawn.encoding, drawn.payload)
            sent["calls" if drawn.call else "messages"] += 1
    return sent


@cache
def _struct(cls: type[Struct]) -> StructType:
    info = type_info(cls)
    assert isinstance(info, StructType)
    return info


def main() -> None:
    """Send random messages, calls and liveliness tokens to a live system, and print as JSON how many of each were sent.

    Arguments of the command line: address of the router, seed, number of messages, and a JSON object with the number of
    motors of each part.
    """
    endpoint, seed, count, parts = sys.argv[1:]
    print(json.dumps(send(endpoint, int(seed), int(count), json.loads(parts))))


if __name__ == "__main__":
    main()
