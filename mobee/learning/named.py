"""Finds an entry by its name in a table, or imports it as `module:name`."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Any, TypeVar

from mobee.errors import InvalidValue, UnknownName

T = TypeVar("T")


def named(kind: str, given: str | T, table: Mapping[str, T]) -> tuple[str, T]:
    """The entry that is meant, and the name under which it is recorded.

    Args:
        kind: what it is, for messages: "explorer", "strategy".
        given: a name in the table; `module:name` of anything that can be imported; or the object itself, which is recorded as the
            `module:name` where it was defined.
        table: the entries that have a name.

    Raises:
        UnknownName: no such name in the table.
        InvalidValue: nothing of that name can be imported, or it cannot be called.
    """
    if isinstance(given, str):
        require_name(kind, given, table)
        if given in table:
            return given, table[given]
        name, found = given, imported(kind, given)
    else:
        name, found = f"{getattr(given, '__module__', '?')}:{getattr(given, '__qualname__', type(given).__qualname__)}", given
    if not callable(found):
        raise InvalidValue(f"{kind} {name!r} is {found!r}, which cannot be called. Valid: {', '.join(table)}, or one of your own.")
    return name, found


def require_name(kind: str, given: str, table: Mapping[str, object]) -> None:
    """Raise UnknownName if that is neither in the table nor `module:name`; imports nothing."""
    if ":" not in given and given not in table:
        raise UnknownName(kind, given, (*table, "module:name of your own"))


def imported(kind: str, path: str) -> Any:
    """What `module:name` stands for; raises InvalidValue if it cannot be imported."""
    module, _, name = path.partition(":")
    try:
        return getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise InvalidValue(f"{kind} {path!r}: {error}. It must be module:name, installed or in the working directory.") from None
