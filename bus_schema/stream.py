# SPDX-License-Identifier: Apache-2.0
"""Streams of the bus: the key and the delivery class of each message, and who may write and read it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal, get_args

Delivery = Literal["CONTROL", "LATEST", "STEP", "STOP", "DATA", "BULK", "EVENTS", "NEWEST"]

Party = Literal[
    "robot_sim", "renderer", "model", "controller", "port_filter", "agent", "behaviour", "vision", "monitor", "recorder", "launcher",
    "operator", "observer", "client", "driver",
]  # fmt: skip
"""The role of a process in the table of who may do what (bus_schema/authority.py): a service, or a kind of program that connects to a
running system. `agent` stands for the agents of all parts, `behaviour` for all behaviours."""

EVERYONE: tuple[Party, ...] = get_args(Party)
READERS_OF_ALL: tuple[Party, ...] = ("recorder", "operator", "observer", "client", "driver")
"""The parties that may read every stream, in addition to the readers that each stream names."""

DELIVERIES: dict[Delivery, str] = {
    "CONTROL": "LATEST in free mode, STEP in lockstep",
    "LATEST": "dropped rather than blocking the sender, high priority; a receiver keeps the newest message only",
    "STEP": "every message, in order: a full queue blocks the sender",
    "STOP": "highest priority, before all others; dropped for a receiver that does not read, so that it delays no other: senders repeat it",
    "DATA": "dropped rather than blocking the sender, lower priority than control",
    "BULK": "as DATA, lowest priority: pictures",
    "EVENTS": "as BULK; a subscriber that joins late gets the last 100 messages",
    "NEWEST": "as BULK; a subscriber that joins late gets the last message",
}
assert tuple(DELIVERIES) == get_args(Delivery)

_CHUNK = re.compile(r"[a-z0-9_]+")
_VARIABLE = re.compile(r"\{(\w+)\}")


def chunk(name: str) -> str:
    """Return `name` unchanged if it can be one part of a key, between two slashes.

    Raises ValueError for an empty name, and for wildcards, blanks, slashes and capital letters.
    """
    if not _CHUNK.fullmatch(name):
        raise ValueError(f"{name!r} cannot be part of a key: use a-z, 0-9 and _ only")
    return name


@dataclass(frozen=True, slots=True)
class Stream:
    """The key and the delivery class of a message; the tables in docs/bus.md are written from these.

    `pattern`: the key, with at most one variable in braces, such as "{part}/state". `delivery`: the delivery class, a key of DELIVERIES,
    which describes how messages are queued and dropped. `writers`: the only parties that may write the stream (bus_schema/authority.py).
    `readers`: the parties that read it, in addition to READERS_OF_ALL. `when`: text for docs/bus.md that says when a message is written.
    """

    pattern: str
    delivery: Delivery
    writers: tuple[Party, ...]
    readers: tuple[Party, ...]
    when: str = ""

    @property
    def variable(self) -> str:
        """The name of the variable in the key, such as "part"; empty if the key is constant."""
        found = _VARIABLE.search(self.pattern)
        return found[1] if found else ""

    def key(self, name: str = "") -> str:
        """Return the key under which a message is published, with `name` in place of the variable.

        Raises ValueError for a name that cannot be part of a key.
        """
        return _VARIABLE.sub(lambda _: chunk(name), self.pattern)

    def keys(self, name: str = "*") -> str:
        """Return the key, or key expression, to subscribe to, with `name` in place of the variable.

        By default the name is *, which matches all values of the variable.
        """
        return self.pattern if not self.variable else _VARIABLE.sub("*", self.pattern) if name == "*" else self.key(name)
