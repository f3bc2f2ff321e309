# SPDX-License-Identifier: Apache-2.0
"""Short recordings that a test writes itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec

from bus_schema import VERSION
from services.recorder.files import Channel, Files

BEGIN = 1_764_000_000_000_000_000  # ns since 1970
HEADER: dict[str, Any] = {"v": VERSION, "run": "run_1", "src": "robot_sim", "seq": 0, "t": 0, "tw": 0}


def message(k: int, **fields: Any) -> bytes:
    return msgspec.msgpack.encode({**HEADER, "k": k, "t": 10_000_000 * k, **fields})


class Writer:
    """A recording to which a test adds messages of any kind, a millisecond apart."""

    def __init__(self, folder: Path, largest: int = 10**9, **settings: str) -> None:
        self.files = Files(folder, largest, {f"{name}.toml": text.encode() for name, text in settings.items()})
        self.written = 0

    def add(self, key: str, kind: str, payload: bytes) -> None:
        encoding = f"application/msgpack;icub/{kind}/{VERSION}" if kind else "json"
        at = BEGIN + 1_000_000 * self.written
        self.files.write(Channel(key, "msgpack" if kind else "json", encoding), payload, at, at)
        self.written += 1

    def tick(self, k: int, **fields: Any) -> None:
        self.add("tick", "Tick", message(k, **fields))
