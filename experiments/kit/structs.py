# SPDX-License-Identifier: Apache-2.0
"""Structs in JSON files.  Unlike msgspec's own JSON, in which infinity becomes null, every float is read as it was written."""

from __future__ import annotations

import json
from typing import Any, TypeVar

import msgspec

T = TypeVar("T")


def encoded(record: Any, indent: int | None = None) -> str:
    """Return a Struct, or a list of them, as JSON text; numbers that are not finite are written as Python's json module writes them."""
    return json.dumps(msgspec.to_builtins(record), indent=indent)


def decoded(text: str, kind: type[T]) -> T:
    """Return what `encoded` has written; raises msgspec.ValidationError for a text of another kind."""
    return msgspec.convert(json.loads(text), type=kind)
