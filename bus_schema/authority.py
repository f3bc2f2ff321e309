# SPDX-License-Identifier: Apache-2.0
"""The rights of each process on the bus: the keys that it may write, read, call and answer.

The rights follow from the fields `writers` and `readers` of each `Stream`, and `servers` and `callers` of each `Call`.  docs/bus.md, the
tests of the services and the access list of a secured system are made from the same fields.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache

from bus_schema.messages import Message
from bus_schema.page import streams
from bus_schema.rpc import CALLS
from bus_schema.stream import EVERYONE, READERS_OF_ALL, Party

AGENT = "agent_"
BEHAVIOURS = ("assist", "gaze")
"""The names of the behaviours, in ascending rank: a behaviour may take a part from an earlier one (services/controller/precedence.py)."""
HOST_LAUNCHER = "launcher_"  # prefix of the name of a launcher that has joined from another host
TOKENS = "alive/{service}/*"
ROUTER = "router"

_PROGRAMS: tuple[Party, ...] = ("observer", "client", "driver")  # a process of theirs may add its number to the name
_OWN = ("{service}", "{source}")  # variables that stand for the name of the writer


@dataclass(frozen=True, slots=True)
class Rights:
    """What one identity (a service, program or person with a certificate) may do on the bus; everything else is denied.

    All fields are key expressions without the namespace. `writes`, `reads`: keys of streams that it may publish and subscribe to. `calls`,
    `answers`: keys of calls that it may make and answer. `tokens`: liveliness tokens that it may declare; every identity may read all
    tokens. `keeps`: streams among `writes` whose past messages it sends to late readers. `catches_up`: streams among `reads` whose past
    messages it may request.
    """

    writes: tuple[str, ...]
    reads: tuple[str, ...]
    calls: tuple[str, ...]
    answers: tuple[str, ...]
    tokens: tuple[str, ...]
    keeps: tuple[str, ...]
    catches_up: tuple[str, ...]


def party_of(name: str) -> Party:
    """Return the party (role) of a process, from its name alone.

    A name that is itself a party, such as `model` or `operator`, is that party. A name that begins with `agent_` is an agent, one that
    begins with `launcher_` is the launcher of another host, and a name in BEHAVIOURS is a behaviour. Every other name is a `client`.
    """
    if name.startswith(AGENT):
        return "agent"
    if name.startswith(HOST_LAUNCHER):
        return "launcher"
    if name in BEHAVIOURS:
        return "behaviour"
    return next((party for party in EVERYONE if party == name and party not in ("agent", "behaviour")), "client")


@lru_cache(1024)
def may_call(who: str, key: str) -> bool:
    """Return whether the table of calls (`bus_schema.rpc.CALLS`) lets the process `who` make the call `key`.

    The result is always True for operators, clients, observers and drivers, because these programs choose their names themselves. An agent
    may make its calls with any part in the key. A secured system is stricter: its router knows the identity of each process, and allows
    operators, clients, observers and drivers only the calls of the table, and an agent only its own part (`rights_of`).
    """
    party = party_of(who)
    allowed = _expressions(_patterns("callers", party), ("*",), "*")
    return party in ("client", "operator", *_PROGRAMS) or any(_matches(expression, key) for expression in allowed)


def _matches(expression: str, key: str) -> bool:
    """Return whether a key expression, in which * stands for one chunk, matches `key`."""
    expected, chunks = expression.split("/"), key.split("/")
    return len(expected) == len(chunks) and all(one in ("*", chunk) for one, chunk in zip(expected, chunks, strict=True))


def rights_of(name: str, party: Party) -> Rights:
    """Return what the identity `name` of the party `party` may do on the bus.

    In the pattern of a key, {service} and {source} stand for the name of the process. An identity may write and answer such a key only with
    its own name in it. Of the keys with {part}, an agent may write and call only those of its own part (agent_PART).
    """
    own, part = _own_names(name, party), name.removeprefix(AGENT) if party == "agent" else "*"
    written = [cls for cls in streams() if party in cls.stream.writers]
    reads_all = party in READERS_OF_ALL
    read = [cls for cls in streams() if party in cls.stream.readers or reads_all]
    return Rights(
        writes=_expressions((cls.stream.pattern for cls in written), own, part),
        reads=("**",) if reads_all else tuple(cls.stream.keys() for cls in read),
        calls=_expressions(_patterns("callers", party), ("*",), part),
        answers=_expressions(_patterns("servers", party), own, "*"),
        tokens=_expressions([TOKENS], own, part),
        keeps=_expressions((cls.stream.pattern for cls in written if _has_history(cls)), own, part),
        catches_up=tuple(cls.stream.keys() for cls in read if _has_history(cls)),
    )


def _own_names(name: str, party: Party) -> tuple[str, ...]:
    """Return the names under which an identity appears on the bus; those of the commands at a terminal begin with mobee."""
    if party == "operator":
        name = "mobee"
    return (name, f"{name}_$*") if party in (*_PROGRAMS, "operator") else (name,)


def _patterns(side: str, party: Party) -> list[str]:
    return [
        call.pattern.replace("{verb}", verb) for call in CALLS if party in getattr(call, side) for verb in call.verbs or ("",)
    ]  # fmt: skip


def _expressions(patterns: Iterable[str], own: tuple[str, ...], part: str) -> tuple[str, ...]:
    found: list[str] = []
    for pattern in patterns:
        names = own if any(variable in pattern for variable in _OWN) else ("",)
        for name in names:
            key = pattern.replace("{part}", part)
            for variable in _OWN:
                key = key.replace(variable, name)
            found.append("/".join("*" if chunk.startswith("{") else chunk for chunk in key.split("/")))
    return tuple(found)


def _has_history(cls: type[Message]) -> bool:
    return cls.stream.delivery in ("EVENTS", "NEWEST")
