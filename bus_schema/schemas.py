# SPDX-License-Identifier: Apache-2.0
"""JSON schemas of the messages, for clients that know msgpack but not this package."""

from __future__ import annotations

import inspect
import re
from functools import cache
from typing import Any, TypeGuard

import msgspec
from msgspec import Struct

from bus_schema import messages, page, rpc
from bus_schema.codec import encoding_of
from bus_schema.messages import Message
from bus_schema.rpc import CALLS, Failure

DIALECT = "https://json-schema.org/draft/2020-12/schema"
_CLASS = re.compile(r"class (\w+)[(:]")
_FIELD = re.compile(r"    (\w+): .+?  # (.*)$")


def keys() -> list[str]:
    """Return the keys of all streams and calls, with variables in braces, in the order of docs/bus.md."""
    calls = [call.pattern.replace("{verb}", verb) for call in CALLS for verb in call.verbs or ("",)]
    return list(dict.fromkeys([*(cls.stream.pattern for cls in _types().values() if _is_stream(cls)), *calls]))


def schemas_of(key: str) -> dict[str, dict[str, Any]]:
    """Return the JSON schemas of what is sent on a key; an empty dict if the contract does not have this key.

    The schema of a stream has the name "message"; a call has "request", "reply" and "failure". `key`: a key such as "left_arm/state" or
    "*/state", or one of those that `keys` returns. It may also be the name of a type, such as "State"; the result is then the schema of
    this type, as "message". Each schema also contains the encoding string of its type, which is sent with each message ("encoding").
    """
    if key in _types():
        return {"message": _schema(_types()[key])}
    for cls in _types().values():
        if _is_stream(cls) and _matches(cls.stream.pattern, key):
            return {"message": _schema(cls)}
    for call in CALLS:
        if any(_matches(call.pattern.replace("{verb}", verb), key) for verb in call.verbs or ("",)):
            return {"request": _schema(call.request), "reply": _schema(call.reply), "failure": _schema(Failure)}
    return {}


@cache
def _types() -> dict[str, type[Struct]]:
    """Return all messages, requests and replies, and the structs inside them, by name, in the order of the source."""
    return {cls.__name__: cls for module in (messages, rpc) for cls in page.structs(module)}


def _is_stream(cls: type[Struct]) -> TypeGuard[type[Message]]:
    return issubclass(cls, Message)


def _matches(pattern: str, key: str) -> bool:
    return key == pattern or re.fullmatch(re.sub(r"\\\{\w+\\\}", r"(?:[a-z0-9_]+|\\*)", re.escape(pattern)), key) is not None


def _schema(cls: type[Struct]) -> dict[str, Any]:
    """Return the schema of a type; fields have the comments of the source, with their units, as descriptions."""
    (root,), parts = msgspec.json.schema_components([cls], ref_template="#/$defs/{name}")
    for name, part in parts.items():
        for field, comment in _comments(_types()[name]).items():
            part["properties"][field] = {**part["properties"][field], "description": comment}
    return {"$schema": DIALECT, "encoding": encoding_of(cls), **root, "$defs": parts}


def _comments(cls: type[Struct]) -> dict[str, str]:
    """Return the comment beside each field, of the class and of those that it extends."""
    return {name: text for base in reversed(cls.__mro__) for name, text in _commented().get(base.__name__, {}).items()}


@cache
def _commented() -> dict[str, dict[str, str]]:
    """Return the comment beside each field, by class and field."""
    found: dict[str, dict[str, str]] = {}
    fields: dict[str, str] = {}
    for line in (line for module in (messages, rpc) for line in inspect.getsource(module).splitlines()):
        if header := _CLASS.match(line):
            fields = found[header[1]] = {}
        elif match := _FIELD.match(line):
            fields[match[1]] = match[2]
    return found
