# SPDX-License-Identifier: Apache-2.0
"""Holds the newest value of everything that the page shows; readers get what has changed since they last asked."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Condition
from typing import Any


@dataclass(frozen=True, slots=True)
class _Item:
    version: int
    text: str  # JSON


class Board:
    """Named values, of which a slow reader skips versions and never gets an old one.  Any thread may call its methods."""

    def __init__(self, record: Callable[[str, str], None] | None = None) -> None:
        """`record`: called with the name and JSON text of every new value."""
        self._items: dict[str, _Item] = {}
        self._changed = Condition()
        self._version = 0
        self._record = record

    @property
    def version(self) -> int:
        """The number of the newest change."""
        return self._version

    def put(self, name: str, value: Any) -> None:
        """Set a value, given as plain JSON data; an equal value is no change."""
        text = json.dumps(value, separators=(",", ":"))
        with self._changed:
            known = self._items.get(name)
            if known is not None and known.text == text:
                return
            self._version += 1
            self._items[name] = _Item(self._version, text)
            self._changed.notify_all()
        if self._record is not None:
            self._record(name, text)

    def record(self, name: str, value: Any) -> None:
        """Record a value that the page itself does not show."""
        if self._record is not None:
            self._record(name, json.dumps(value, separators=(",", ":")))

    def news(self, after: int, patience: float) -> str:
        """Return the values that changed after a version, as a JSON object with the present `version`; waits for one for `patience` s."""
        give_up = time.monotonic() + patience
        with self._changed:
            while self._version <= after and (left := give_up - time.monotonic()) > 0.0:
                self._changed.wait(left)
            if after > self._version:  # of a server that ran before this one
                after = 0
            return _object({name: one.text for name, one in self._items.items() if one.version > after}, self._version)


def _object(texts: Mapping[str, str], version: int) -> str:
    return "{" + ",".join([f'"version":{version}', *(f"{json.dumps(name)}:{text}" for name, text in texts.items())]) + "}"
