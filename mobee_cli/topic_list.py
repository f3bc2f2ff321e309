"""`mobee topic list`: all keys with type, rate and size."""

from __future__ import annotations

import argparse
import json
import time
from typing import Any

from services.common.observe import Heard, listen


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--duration", type=float, default=1.0, metavar="S", help="seconds to listen (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print as JSON")


def run(session: Any, arguments: argparse.Namespace) -> int:
    """Listen to everything for a while, then print."""
    heard: dict[str, list[Heard]] = {}
    listen(session, "**", lambda message: heard.setdefault(message.key, []).append(message))
    time.sleep(arguments.duration)
    topics = [
        {
            "key": key,
            "type": messages[-1].type,
            "rate_hz": len(messages) / arguments.duration,
            "bytes": sum(len(message.payload) for message in messages) / len(messages),
        }
        for key, messages in sorted(list(heard.items()))
    ]
    if arguments.json:
        print(json.dumps(topics, indent=2))
        return 0
    print(f"{'key':<40}{'type':<14}{'rate Hz':>10}{'bytes':>12}")
    for topic in topics:
        print(f"{topic['key']:<39.39} {topic['type']:<13.13} {topic['rate_hz']:>10.1f}{topic['bytes']:>12.0f}")
    return 0
