"""`mobee topic echo`: every message on a key, a line of JSON each."""

from __future__ import annotations

import argparse
import json
import sys
import time
from queue import Empty, SimpleQueue
from typing import Any

from services.common.observe import Heard, listen

_HINT_AFTER = 1.0  # s


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Key and options."""
    parser.add_argument("key", help="key expression, for example left_arm/state or '*/motion'")
    parser.add_argument("--count", type=int, default=sys.maxsize, metavar="N", help="end after so many messages")
    parser.add_argument("--duration", type=float, default=float("inf"), metavar="S", help="end after so many seconds")
    parser.add_argument("--json", action="store_true", help="as always: one JSON object a line")


def run(session: Any, arguments: argparse.Namespace) -> int:
    """Print until count, duration or Ctrl-C."""
    queue: SimpleQueue[Heard] = SimpleQueue()
    listen(session, arguments.key, queue.put)
    begun, count, hinted = time.monotonic(), 0, False
    while count < arguments.count and time.monotonic() < begun + arguments.duration:
        try:
            heard = queue.get(timeout=0.1)
        except Empty:
            if not (count or hinted) and time.monotonic() > begun + _HINT_AFTER:
                hinted = True
                print(f"nothing on {arguments.key!r} yet; `mobee topic list` shows what there is", file=sys.stderr)
            continue
        print(json.dumps({"key": heard.key, "type": heard.type, **_message(heard)}), flush=True)
        count += 1
    return 0


def _message(heard: Heard) -> dict[str, Any]:
    try:
        return {"message": _printable(heard.content())}
    except ValueError as error:
        return {"error": str(error), "bytes": len(heard.payload)}


def _printable(value: Any) -> Any:
    """Pictures are said by their size."""
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    if isinstance(value, dict):
        return {str(key): _printable(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_printable(item) for item in value]
    return value if isinstance(value, str | int | float | bool | None) else str(value)
