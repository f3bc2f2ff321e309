# SPDX-License-Identifier: Apache-2.0
"""Functions for tools that observe a running system: services that are present, messages that are published."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import msgspec
import zenoh
from zenoh.handlers import Callback

from bus_schema import UNDECODABLE, keys, type_of
from bus_schema.rpc import Stat
from services.common import rpc
from services.common.bus import other_key


@dataclass(frozen=True, slots=True)
class Received:
    """A message of any type, not decoded. `at`: time at which it was received, s of the monotonic clock."""

    key: str
    encoding: str
    payload: bytes
    at: float

    @property
    def type(self) -> str:
        """The name of the message's type, or the whole encoding string if it is not a message of this project."""
        return type_of(self.encoding) or self.encoding

    def content(self) -> Any:
        """Return the message as dicts, lists and values, unchecked; raises ValueError if it is not msgpack."""
        try:
            return msgspec.msgpack.decode(self.payload)
        except UNDECODABLE as error:
            raise ValueError(f"not msgpack: {error}") from None


def listen(session: zenoh.Session, key: str, handle: Callable[[Received], None]) -> None:
    """Call `handle` for every message on the key expression `key`, in a thread of Zenoh, until the session is closed.

    `handle` must not wait. A message that arrives under another key than the one under which it was sent is dropped. Raises ValueError if
    the key expression is not valid.
    """

    def enqueue(sample: zenoh.Sample) -> None:
        if other_key(sample):
            return
        handle(Received(str(sample.key_expr), str(sample.encoding), sample.payload.to_bytes(), time.monotonic()))

    try:
        # Not by a thread of Python, which would still handle waiting messages while the interpreter ends, and crash it.
        session.declare_subscriber(zenoh.KeyExpr(key), Callback(enqueue, indirect=False))
    except zenoh.ZError as error:
        raise ValueError(str(error).partition(" at /")[0]) from None


def alive(session: zenoh.Session) -> dict[str, list[str]]:
    """Return a dict from the name of a service to the ids of its running processes, from their liveliness tokens."""
    found: dict[str, list[str]] = {}
    for answer in session.liveliness().get(keys.ALL_ALIVE, timeout=1.0):
        if answer.ok is not None:
            _, who, instance = str(answer.ok.key_expr).split("/")
            found.setdefault(who, []).append(instance)
    return found


def stats(session: zenoh.Session, names: list[str], timeout: float = 1.0) -> dict[str, Stat]:
    """Return a dict from each of the services `names` to its status; all are asked at the same time.

    Services that do not answer within `timeout` [s] are left out.
    """
    answers: dict[str, Stat | rpc.CallFailed] = {}

    def ask(who: str) -> None:
        def note(answer: Stat | rpc.CallFailed) -> None:
            answers[who] = answer

        rpc.ask(session, "mobee", keys.service_rpc(who, "stat"), Stat, note, timeout=timeout)

    for who in names:
        ask(who)
    give_up = time.monotonic() + timeout + 0.5
    while len(answers) < len(names) and time.monotonic() < give_up:
        time.sleep(0.005)
    return {who: answer for who, answer in sorted(answers.items()) if isinstance(answer, Stat)}
