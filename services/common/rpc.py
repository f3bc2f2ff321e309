"""Calls with a time limit: an answer, or an error that says which."""

from __future__ import annotations

import uuid
from collections.abc import Callable
from typing import TypeVar

import zenoh
from zenoh.handlers import Callback

from bus_schema import VERSION, Refused, decode, encode, encoding_of
from bus_schema.rpc import Empty, Failure, Reply, Request

_R = TypeVar("_R", bound=Reply)
TIMEOUT = 0.5  # s
LOCKED_TIMEOUT = 1.5  # s, in lockstep: within its ceiling, so that a busy machine makes no difference


class CallFailed(Exception):
    """A call without the wanted answer; `code` is the server's, or no_answer, or bad_answer."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


def call(
    session: zenoh.Session,
    who: str,
    key: str,
    request: type[Request],
    reply: type[_R],
    *,
    timeout: float = TIMEOUT,
    tries: int = 1,
    **fields: object,
) -> _R:
    """Ask the service behind `key`; raises CallFailed.  An empty answer means that nobody is there.

    `tries`: how often a call that nobody answers is sent; with one id, so that it happens once.
    """
    payload = encode(request(v=VERSION, id=uuid.uuid4().hex, who=who, **fields))
    for left in reversed(range(tries)):
        try:
            for answer in session.get(key, payload=payload, encoding=encoding_of(request), timeout=timeout):
                return _read(key, answer, reply)
        except CallFailed as failed:
            if failed.code != "no_answer" or not left:
                raise
    raise CallFailed("no_answer", f"{key}: nobody answers")


def ask(
    session: zenoh.Session,
    who: str,
    key: str,
    reply: type[_R],
    done: Callable[[_R | CallFailed], None],
    *,
    request: type[Request] = Empty,
    timeout: float = TIMEOUT,
    **fields: object,
) -> None:
    """Call that does not wait: `done` gets the answer or the failure, once, on a thread of Zenoh."""
    message = request(v=VERSION, id=uuid.uuid4().hex, who=who, **fields)
    answers: list[zenoh.Reply] = []

    def finish() -> None:
        result: _R | CallFailed = CallFailed("no_answer", f"{key}: nobody answers")
        if answers:
            try:
                result = _read(key, answers[0], reply)
            except CallFailed as failed:
                result = failed
        done(result)

    session.get(key, payload=encode(message), encoding=encoding_of(request), timeout=timeout, handler=Callback(answers.append, finish))


def _read(key: str, answer: zenoh.Reply, reply: type[_R]) -> _R:
    if answer.ok is None:
        raise _failure(key, answer)
    try:
        return decode(reply, answer.ok.payload.to_bytes(), str(answer.ok.encoding))
    except Refused as refused:
        raise CallFailed("bad_answer", f"{key}: {refused}") from None


def _failure(key: str, answer: zenoh.Reply) -> CallFailed:
    error = answer.err
    if error is None:
        return CallFailed("no_answer", f"{key}: an answer without content")
    try:
        failure = decode(Failure, error.payload.to_bytes(), str(error.encoding))
    except Refused:  # Zenoh's own errors are plain text, its timeout among them
        return CallFailed("no_answer", f"{key}: {error.payload.to_bytes()[:200].decode(errors='replace')}")
    return CallFailed(failure.code, failure.text)
