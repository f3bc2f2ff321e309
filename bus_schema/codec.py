# SPDX-License-Identifier: Apache-2.0
"""Encodes messages as msgpack, and decodes them.

A message is refused, with a reason, if its type, its version or the length of a vector is wrong, or if it contains NaN or infinity.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import msgspec
from msgspec import Meta, Struct

from bus_schema.version import VERSION

_S = TypeVar("_S", bound=Struct)
_PREFIX = "application/msgpack;icub/"
_encoder = msgspec.msgpack.Encoder()


UNDECODABLE = (msgspec.MsgspecError, ValueError, RecursionError)
"""The exceptions that msgspec raises for bytes that it cannot decode. ValueError includes UnicodeDecodeError, for text that is not
UTF-8."""


class Refused(Exception):
    """Raised for a message that must not be used.

    `reason`: a short code, by which refused messages are counted. The codec uses type, version, decode, length and value; receivers have
    further reasons (docs/bus.md).
    """

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


@cache
def encoding_of(cls: type[Struct]) -> str:
    """Return the encoding string that is sent with each message of the type `cls`: application/msgpack;icub/TYPE/VERSION."""
    return f"{_PREFIX}{cls.__name__}/{VERSION}"


def type_of(encoding: str) -> str:
    """Return the name of the message type in an encoding string, such as State; empty unless it begins as in `encoding_of`."""
    return encoding.removeprefix(_PREFIX).partition("/")[0] if encoding.startswith(_PREFIX) else ""


def encode(message: Struct) -> bytes:
    """Return a message encoded as msgpack."""
    return _encoder.encode(message)


def decode(cls: type[_S], payload: bytes, encoding: str, *, part: int | None = None, robot: int | None = None) -> _S:
    """Return the message of the type `cls` that is encoded in `payload`, after all checks.

    `encoding`: the encoding string that came with the payload. `part`, `robot`: number of motors that PartVector and RobotVector fields
    must have (None: not checked). Raises Refused with one of these reasons: type (another message type in the encoding string), version
    (another version in the encoding string or in the field `v`), decode (the payload does not match the struct), length (a vector has a
    wrong length), or value (NaN or infinity).
    """
    if encoding != encoding_of(cls):
        _refuse_encoding(cls, encoding)
    try:
        message = _decoder(cls).decode(payload)
    except UNDECODABLE as error:
        raise Refused("decode", f"{cls.__name__}: {error}") from None
    version = getattr(message, "v", VERSION)
    if version != VERSION:
        raise Refused("version", f"{cls.__name__}: version {version}, this side speaks {VERSION}")
    _check_lengths(message, part, robot)
    if not _struct_finite(message):
        raise Refused("value", f"{cls.__name__}: NaN or infinity")
    return message  # type: ignore[no-any-return]  # the decoder was made for cls


def _refuse_encoding(cls: type[Struct], encoding: str) -> None:
    own = f"{_PREFIX}{cls.__name__}/"
    if encoding.startswith(own) and (version := encoding.removeprefix(own)):
        raise Refused("version", f"{cls.__name__}: version {version[:20]}, this side speaks {VERSION}")
    raise Refused("type", f"expected {encoding_of(cls)!r}, got {encoding[:80]!r}")


@cache
def _decoder(cls: type[Struct]) -> msgspec.msgpack.Decoder[Any]:
    return msgspec.msgpack.Decoder(cls)


@cache
def _vectors(cls: type[Struct]) -> tuple[tuple[str, str], ...]:
    """Return (field, "part" or "robot") for every field whose length depends on the robot."""
    found = []
    for name, hint in get_type_hints(cls, include_extras=True).items():
        kind = _length_kind(hint)
        if kind:
            found.append((name, kind))
    return tuple(found)


def _length_kind(hint: Any) -> str | None:
    for meta in getattr(hint, "__metadata__", ()):
        if isinstance(meta, Meta) and meta.extra and "length" in meta.extra:
            return str(meta.extra["length"])
    if get_origin(hint) is not None:
        for inner in get_args(hint):
            kind = _length_kind(inner)
            if kind:
                return kind
    return None


def _check_lengths(message: Struct, part: int | None, robot: int | None) -> None:
    for name, kind in _vectors(type(message)):
        expected, value = part if kind == "part" else robot, getattr(message, name)
        if expected is None or value is None:
            continue
        for vector in value.values() if isinstance(value, dict) else (value,):
            if len(vector) != expected:
                raise Refused("length", f"{type(message).__name__}.{name}: {len(vector)} numbers, expected {expected}")


@cache
def _numbers(cls: type[Struct]) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Return the names of the fields of three kinds: a float, a list of floats, a value that contains floats; others are always finite."""
    kinds = {name: _number_kind(hint) for name, hint in get_type_hints(cls).items()}
    return (
        tuple(name for name, kind in kinds.items() if kind == "float"),
        tuple(name for name, kind in kinds.items() if kind == "floats"),
        tuple(name for name, kind in kinds.items() if kind == "mixed"),
    )


def _number_kind(hint: Any) -> str:
    if hint is float:
        return "float"
    if isinstance(hint, type) and issubclass(hint, Struct):
        return "mixed" if any(_numbers(hint)) else ""
    inner = [kind for kind in map(_number_kind, get_args(hint)) if kind]
    return "" if not inner else "floats" if get_origin(hint) is list and inner == ["float"] else "mixed"


def _finite(value: Any) -> bool:
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, list):
        return _all_finite(value) if value and isinstance(value[0], float) else all(map(_finite, value))
    if isinstance(value, dict):
        return all(map(_finite, value.values()))
    if isinstance(value, Struct):
        return _struct_finite(value)
    return True


def _struct_finite(message: Struct) -> bool:
    singles, lists, mixed = _numbers(type(message))
    for name in singles:
        if not math.isfinite(getattr(message, name)):
            return False
    for name in lists:
        values = getattr(message, name)
        if not math.isfinite(sum(values)) and not _all_finite(values):
            return False
    return all(_finite(getattr(message, name)) for name in mixed) if mixed else True


def _all_finite(values: list[float]) -> bool:
    return math.isfinite(sum(values)) or all(map(math.isfinite, values))  # the sum is quicker, but may overflow
