# SPDX-License-Identifier: Apache-2.0
"""Structs in JSON files.  Unlike msgspec's own JSON, in which infinity becomes null, every float is read as it was written."""

from __future__ import annotations

import json
from typing import Any, TypeVar

import msgspec

T = TypeVar("T")


def encoded(record: Any, indent: int | None = None) -> str:
    """Return a msgspec Struct, or a list of Structs, as JSON text; numbers that are not finite are written as Infinity, -Infinity or NaN.

    `indent`: spaces for each level; None: all in one line.  `record`: the Struct or list.
    """
    return json.dumps(msgspec.to_builtins(record), indent=indent)


def decoded(text: str, kind: type[T]) -> T:
    """Return the object of type `kind` that `encoded` has written as `text`; raises msgspec.ValidationError for another type."""
    return msgspec.convert(json.loads(text), type=kind)
