"""Calls that reach a service: each is answered once, however often it is repeated."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import TypeVar

import zenoh

from bus_schema import VERSION, Refused, decode, encode, encoding_of
from bus_schema.rpc import Failure, Reply, Request
from services.common.bus import Bus

_Q = TypeVar("_Q", bound=Request)

REMEMBERED = 256  # replies kept, so that a repeated call is harmless


class CallRefused(Exception):
    """Raised by a request's handler: the caller gets code and text."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(text)
        self.code = code


class Answering:
    """Decodes requests, has them handled, and replies."""

    def __init__(self, bus: Bus) -> None:
        self.bus = bus
        self._replies: OrderedDict[tuple[str, str], tuple[type[Reply], bytes]] = OrderedDict()

    def answer(self, query: zenoh.Query, declared: str, cls: type[_Q], handler: Callable[[_Q, str], Reply], part_of_key: bool) -> None:
        """Reply to a query on the `declared` key: handler(request, key) -> reply, or CallRefused."""
        key = str(query.key_expr) if "*" in declared else declared  # answers to one wildcard call must differ by key
        with query:
            try:
                reply_type, payload = self._reply(query, cls, handler, key, part_of_key)
            except (Refused, CallRefused) as refused:
                code = refused.reason if isinstance(refused, Refused) else refused.code
                self.bus.reject(code, f"{key}: {refused}")
                query.reply_err(encode(Failure(v=VERSION, code=code, text=str(refused)[:2000])), encoding=encoding_of(Failure))
                return
            query.reply(key, payload, encoding=encoding_of(reply_type))

    def _reply(
        self, query: zenoh.Query, cls: type[_Q], handler: Callable[[_Q, str], Reply], key: str, part_of_key: bool
    ) -> tuple[type[Reply], bytes]:
        size = None
        if part_of_key:
            part = key.split("/")[0]
            if part not in self.bus.part_sizes:
                raise CallRefused("part", f"no part {part!r}; there are {', '.join(self.bus.part_sizes)}")
            size = self.bus.part_sizes[part]
        if query.payload is None or query.encoding is None:
            raise Refused("decode", f"{cls.__name__}: an empty request")
        request = decode(cls, query.payload.to_bytes(), str(query.encoding), part=size, robot=self.bus.robot_size)
        call = (key, request.id)
        if call not in self._replies:
            reply = handler(request, key)
            self._replies[call] = (type(reply), encode(reply))
            if len(self._replies) > REMEMBERED:
                self._replies.popitem(last=False)
        return self._replies[call]
