# SPDX-License-Identifier: Apache-2.0
"""Calls with a time limit, client and server; a repeated call has its effect only once."""

from __future__ import annotations

import uuid
from collections import OrderedDict, deque
from collections.abc import Callable
from typing import TypeVar

import zenoh
from msgspec import Struct
from zenoh.handlers import Callback

from bus_schema import VERSION, Refused, decode, encode, encoding_of, keys
from bus_schema.authority import may_call
from bus_schema.messages import Served
from bus_schema.rpc import Empty, Failure, Reply, Request
from mobee.errors import MobeeError
from services.common.bus import Bus, require_key
from services.common.identity import Identity

_R = TypeVar("_R", bound=Reply)
TIMEOUT = 0.5  # s
FLUSH_TIMEOUT = 0.5  # s
LOCKED_TIMEOUT = 1.5  # s, in lockstep: shorter than its patience, so that the load of the machine changes nothing


class CallFailed(Exception):
    """Raised for a call without a valid reply.

    `code`: the code with which the server has refused the call, "no_answer" if no reply came in time, or "bad_answer" if the reply does not
    match its type.
    """

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
    """Call the service that answers `key`, wait for the reply and return it; raises CallFailed.

    Args:
        session: session of the caller.
        who: name of the caller.
        key: key of the call.
        request: type of the request.
        reply: type of the reply.
        timeout: time to wait for each try, s.
        tries: how many times the call is sent while there is no answer; all have the same id, so that the call takes effect at most once.
        fields: fields of the request.
    """
    payload = encode(request(v=VERSION, id=uuid.uuid4().hex, who=who, **fields))
    for left in reversed(range(tries)):
        try:
            for answer in session.get(key, payload=payload, encoding=encoding_of(request), attachment=key, timeout=timeout):
                return _read(key, answer, reply)
        except CallFailed as failed:
            if failed.code != "no_answer" or not left:
                raise
    raise CallFailed("no_answer", _no_answer(key))


def flush(session: zenoh.Session, who: str) -> None:
    """Wait until the router has received every message sent so far, for at most 0.5 s (FLUSH_TIMEOUT).

    Call this before you close a session; otherwise messages can be lost. When a session is closed, Zenoh drops the messages that it is
    still sending. If the router then cannot write to the closed connection, it also drops the messages that it has not read from there.
    This function sends the router a call with the lowest priority. The router answers it after all earlier messages, even if no process
    serves this call. `who`: name of the calling process.
    """
    key, lowest = keys.service_rpc("router", "stat"), zenoh.Priority.BACKGROUND
    payload = encode(Empty(v=VERSION, id=uuid.uuid4().hex, who=who))
    answers = session.get(key, payload=payload, encoding=encoding_of(Empty), attachment=key, priority=lowest, timeout=FLUSH_TIMEOUT)
    deque(answers, maxlen=0)


def ask(
    session: zenoh.Session,
    who: str,
    key: str,
    reply: type[_R],
    done: Callable[[_R | CallFailed], None],
    *,
    request: type[Request] = Empty,
    timeout: float = TIMEOUT,
    wanted: Callable[[_R], bool] | None = None,
    **fields: object,
) -> None:
    """Call the service that answers `key` without waiting; a thread of Zenoh calls `done` once with the reply, or with a CallFailed.

    `who`: name of the caller. `request`, `reply`: types of request and reply. `fields`: fields of the request. `timeout`: s. `wanted`: if
    several processes may answer, a function that returns True for the reply to use; if it is True for none, `done` gets the first.
    """
    message = request(v=VERSION, id=uuid.uuid4().hex, who=who, **fields)
    answers: list[zenoh.Reply] = []

    def finish() -> None:
        results = [_result(key, answer, reply) for answer in (answers if wanted is not None else answers[:1])]
        chosen = (one for one in results if wanted is not None and not isinstance(one, CallFailed) and wanted(one))
        done(next(chosen, results[0] if results else CallFailed("no_answer", _no_answer(key))))

    session.get(
        key,
        payload=encode(message),
        encoding=encoding_of(request),
        attachment=key,
        timeout=timeout,
        handler=Callback(answers.append, finish),
        consolidation=None if wanted is None else zenoh.ConsolidationMode.NONE,
    )


def _result(key: str, answer: zenoh.Reply, reply: type[_R]) -> _R | CallFailed:
    try:
        return _read(key, answer, reply)
    except CallFailed as failed:
        return failed


def _no_answer(key: str) -> str:
    identity = Identity.of_environment()
    return f"{key}: no service answers" + (f", or {identity.name} may not call it" if identity else "")


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
        return CallFailed("no_answer", f"{key}: the answer is empty")
    try:
        failure = decode(Failure, error.payload.to_bytes(), str(error.encoding))
    except Refused:  # Zenoh's own errors, such as a timeout, are plain text
        return CallFailed("no_answer", f"{key}: {error.payload.to_bytes()[:200].decode(errors='replace')}")
    return CallFailed(failure.code, failure.text)


_Q = TypeVar("_Q", bound=Request)

REMEMBERED = 256  # replies kept for repeated calls
LARGEST_PUBLISHED = 1_000_000  # bytes; a larger request is refused, and its content is not recorded
_NOT_PUBLISHED = ("/rpc/stat", "/rpc/config")  # calls that the launcher and tools repeat, and that change nothing


class CallRefused(Exception):
    """Raised by the handler of a request to refuse it; the caller receives `code` (short code of the reason) and `text`."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


class Answering:
    """The server's side of calls: decodes requests, calls their handlers, replies, and publishes each call for the recorder."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self._served = bus.publisher(Served, bus.who)
        self._replies: OrderedDict[tuple[str, str], tuple[type[Reply], bytes]] = OrderedDict()

    def answer(self, query: zenoh.Query, declared: str, cls: type[_Q], handler: Callable[[_Q, str], Reply], part_of_key: bool) -> None:
        """Reply to a query with the result of handler(request, key), or with the refusal that the handler raises (CallRefused).

        `declared`: key or key expression that the service has declared for these queries. `cls`: type of the request. `part_of_key`: True:
        the key begins with the name of a part; a vector of the request with one entry per motor of a part must then have as many entries
        as this part has motors.
        """
        key = str(query.key_expr) if "*" in declared else declared  # answers to one call with a wildcard must differ by key
        with query:
            try:
                reply_type, payload = self._reply(query, cls, handler, key, part_of_key)
            except (Refused, CallRefused) as refused:
                code = refused.reason if isinstance(refused, Refused) else refused.code
                self.bus.reject(code, f"{key}: {refused}")
                self._fail(query, key, cls, code, str(refused))
                return
            except MobeeError:
                raise
            except Exception as error:  # as in Bus.guarded
                self._fail(query, key, cls, "handler", self.bus.report_defect(key, error))
                return
            query.reply(key, payload, encoding=encoding_of(reply_type))

    def _reply(
        self, query: zenoh.Query, cls: type[_Q], handler: Callable[[_Q, str], Reply], key: str, part_of_key: bool
    ) -> tuple[type[Reply], bytes]:
        require_key(query)
        size = None
        if part_of_key:
            part = key.split("/")[0]
            if part not in self.bus.part_sizes:
                raise CallRefused("part", f"no part {part!r}; this robot has {', '.join(self.bus.part_sizes)}")
            size = self.bus.part_sizes[part]
        if query.payload is None or query.encoding is None:
            raise Refused("decode", f"{cls.__name__}: the request is empty")
        request = decode(cls, query.payload.to_bytes(), str(query.encoding), part=size, robot=self.bus.robot_size)
        if not may_call(request.who, key):
            raise CallRefused("caller", f"{request.who} may not call {key}; docs/bus.md lists who may")
        call = (key, request.id)
        if call not in self._replies:
            reply = handler(request, key)
            self._replies[call] = (type(reply), encode(reply))
            self._publish(query, key, cls, *self._replies[call])
            if len(self._replies) > REMEMBERED:
                self._replies.popitem(last=False)
        return self._replies[call]

    def _fail(self, query: zenoh.Query, key: str, cls: type[Request], code: str, text: str) -> None:
        failure = encode(Failure(v=VERSION, code=code, text=text[:2000]))
        query.reply_err(failure, encoding=encoding_of(Failure))
        self._publish(query, key, cls, Failure, failure)

    def _publish(self, query: zenoh.Query, key: str, cls: type[Request], reply_type: type[Struct], reply: bytes) -> None:
        if key.endswith(_NOT_PUBLISHED) or not self._served.has_subscribers:
            return
        request = b"" if query.payload is None else query.payload.to_bytes()
        if len(request) <= LARGEST_PUBLISHED:
            self._served.put(key=key, request=request, request_type=cls.__name__, reply=reply, reply_type=reply_type.__name__)
