# SPDX-License-Identifier: Apache-2.0
"""Holds the newest value of everything that the monitor's web page shows. A page asks for what has changed since its last request."""

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
    """The named values that the monitor's web page shows.

    Each change has a number (version). A slow page skips old versions and always gets the newest. Any thread may call the methods.
    """

    def __init__(self, record: Callable[[str, str], None] | None = None) -> None:
        """Create an empty board; `record`: called with the name and the JSON text of every new value."""
        self._items: dict[str, _Item] = {}
        self._changed = Condition()
        self._version = 0
        self._record = record

    @property
    def version(self) -> int:
        """The number of the newest change; 0 before the first."""
        return self._version

    def put(self, name: str, value: Any) -> None:
        """Set the value of a name, as plain JSON data. Nothing changes if the value equals the present one."""
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
        """Pass a value to the function `record` that was given to `__init__` (it records the run); the page does not show the value."""
        if self._record is not None:
            self._record(name, json.dumps(value, separators=(",", ":")))

    def news(self, after: int, patience: float) -> str:
        """Return the values that have changed since version `after`, as a JSON text.

        It is an object with the newest `version`, and the changed values by name. If nothing has changed, the call waits for a change for
        at most `patience` s.
        """
        give_up = time.monotonic() + patience
        with self._changed:
            while self._version <= after and (left := give_up - time.monotonic()) > 0.0:
                self._changed.wait(left)
            if after > self._version:  # of a server that ran before this one
                after = 0
            return _object({name: one.text for name, one in self._items.items() if one.version > after}, self._version)


def _object(texts: Mapping[str, str], version: int) -> str:
    return "{" + ",".join([f'"version":{version}', *(f"{json.dumps(name)}:{text}" for name, text in texts.items())]) + "}"
