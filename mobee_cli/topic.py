# SPDX-License-Identifier: Apache-2.0
"""`mobee topic`: shows the messages on the bus (list, echo, hz) and their types (schema)."""

from __future__ import annotations

import argparse
import difflib
import json
import statistics
import sys
import time
from collections.abc import Callable
from queue import Empty, Queue
from typing import Any

from mobee_cli.connect import add_endpoint, connected
from mobee_cli.errors import UserError
from services.common.exit_codes import BAD_INPUT, FAILED, OK
from services.common.observe import Received, listen

HINT_DELAY = 1.0  # s without a message until `echo` prints a hint
HZ_WINDOW = 1.0  # s that each line of `hz` covers


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee topic` to the parser: one subcommand for each action (list, echo, hz, schema)."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="|".join(_ACTIONS))
    for name, (text, add, _) in _ACTIONS.items():
        action = actions.add_parser(name, description=text, help=text)
        if name != "schema":  # of the contract, which is the same with and without a running system
            add_endpoint(action)
        add(action)


def run(arguments: argparse.Namespace) -> int:
    """Run the action of `mobee topic` that the arguments name, connected to the running system if the action needs it.

    Returns the exit code.
    """
    if arguments.action == "schema":
        return _schema(None, arguments)
    with connected(arguments.endpoint) as session:
        try:
            return _ACTIONS[arguments.action][2](session, arguments)
        except ValueError as error:
            raise UserError(str(error), BAD_INPUT) from None
        except KeyboardInterrupt:
            if arguments.action == "list":
                raise
            return OK  # Ctrl-C is the usual end of the others


def _add_list(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--duration", type=float, default=1.0, metavar="S", help="seconds to listen (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print as JSON")


def _list(session: Any, arguments: argparse.Namespace) -> int:
    """Listen to all keys for a while, then print them."""
    received: dict[str, list[Received]] = {}
    listen(session, "**", lambda message: received.setdefault(message.key, []).append(message))
    time.sleep(arguments.duration)
    topics = [
        {
            "key": key,
            "type": messages[-1].type,
            "rate_hz": len(messages) / arguments.duration,
            "bytes": sum(len(message.payload) for message in messages) / len(messages),
        }
        for key, messages in sorted(list(received.items()))
    ]
    if arguments.json:
        print(json.dumps(topics, indent=2))
        return OK
    print(f"{'key':<40}{'type':<14}{'rate Hz':>10}{'bytes':>12}")
    for topic in topics:
        print(f"{topic['key']:<39.39} {topic['type']:<13.13} {topic['rate_hz']:>10.1f}{topic['bytes']:>12.0f}")
    return OK


def _add_echo(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("key", help="key expression, for example left_arm/state or '*/motion'")
    parser.add_argument("--count", type=int, default=sys.maxsize, metavar="N", help="end after N messages")
    parser.add_argument("--duration", type=float, default=float("inf"), metavar="S", help="end after S seconds")
    parser.add_argument("--json", action="store_true", help="changes nothing: the output is always one JSON object per line")


def _echo(session: Any, arguments: argparse.Namespace) -> int:
    """Print messages until the count, the duration or Ctrl-C ends it."""
    queue: Queue[Received] = Queue()
    listen(session, arguments.key, queue.put)
    begun, count, hinted = time.monotonic(), 0, False
    while count < arguments.count and time.monotonic() < begun + arguments.duration:
        try:
            received = queue.get(timeout=0.1)
        except Empty:
            if not (count or hinted) and time.monotonic() > begun + HINT_DELAY:
                hinted = True
                print(f"nothing on {arguments.key!r} yet; `mobee topic list` shows the keys in use", file=sys.stderr)
            continue
        print(json.dumps({"key": received.key, "type": received.type, **_message(received)}), flush=True)
        count += 1
    return OK


def _message(received: Received) -> dict[str, Any]:
    try:
        return {"message": _printable(received.content())}
    except ValueError as error:
        return {"error": str(error), "bytes": len(received.payload)}


def _printable(value: Any) -> Any:
    """Return a value as JSON has it; bytes, such as pictures, are replaced by their size."""
    if isinstance(value, bytes):
        return f"{len(value)} bytes"
    if isinstance(value, dict):
        return {str(key): _printable(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_printable(item) for item in value]
    return value if isinstance(value, str | int | float | bool | None) else str(value)


def _add_hz(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("key", help="key expression, for example clock or left_arm/state")
    parser.add_argument("--duration", type=float, default=float("inf"), metavar="S", help="end after S seconds")
    parser.add_argument("--json", action="store_true", help="print one JSON object per line")


def _hz(session: Any, arguments: argparse.Namespace) -> int:
    """Print a line per second; the exit code is 1 if no message came."""
    times: list[float] = []
    listen(session, arguments.key, lambda received: times.append(received.at))
    end, seen, came = time.monotonic() + arguments.duration, 0, False
    while time.monotonic() < end:
        time.sleep(max(0.0, min(HZ_WINDOW, end - time.monotonic())))
        window = times[max(0, seen - 1) :]  # with the last message of the window before, from which the first period is counted
        seen += len(window) - (1 if seen else 0)
        came = came or seen > 0
        figures = _figures(window)
        print(json.dumps(figures) if arguments.json else _as_text(figures), flush=True)
    return OK if came else FAILED


def _figures(times: list[float]) -> dict[str, float | int | None]:
    """Return the rate in Hz, and periods and their standard deviation (jitter) in s; None with fewer than two messages."""
    periods = [after - before for before, after in zip(times, times[1:], strict=False)]
    if not periods:
        return {"messages": len(times), "rate_hz": None, "period_s": None, "jitter_s": None, "shortest_s": None, "longest_s": None}
    mean = statistics.fmean(periods)
    return {
        "messages": len(periods),
        "rate_hz": 1 / mean if mean > 0 else None,
        "period_s": mean,
        "jitter_s": statistics.pstdev(periods),
        "shortest_s": min(periods),
        "longest_s": max(periods),
    }


def _as_text(figures: dict[str, float | int | None]) -> str:
    rate, mean, jitter, low, high = (figures[name] for name in ("rate_hz", "period_s", "jitter_s", "shortest_s", "longest_s"))
    if rate is None or mean is None or jitter is None or low is None or high is None:
        return "no messages"
    return f"{rate:8.1f} Hz   period {mean * 1e3:8.2f} ms   jitter {jitter * 1e3:6.2f}   {low * 1e3:.2f} .. {high * 1e3:.2f} ms"


def _add_schema(parser: argparse.ArgumentParser) -> None:
    text = "key, for example left_arm/state or model/rpc/world/add, or the name of a type (default: list all keys)"
    parser.add_argument("key", nargs="?", help=text)
    parser.add_argument("--json", action="store_true", help="changes nothing for a key: schemas are JSON; without a key, print a list")


def _schema(session: None, arguments: argparse.Namespace) -> int:
    """Print the JSON schemas of a key, or all keys."""
    from bus_schema.schemas import keys, schemas_of

    if arguments.key is None:
        print(json.dumps(keys(), indent=2) if arguments.json else "\n".join(keys()))
        return OK
    found = schemas_of(arguments.key)
    if not found:
        near = difflib.get_close_matches(arguments.key, keys(), n=1, cutoff=0.5)
        hint = f" Did you mean {near[0]!r}?" if near else ""
        raise UserError(f"no message of the bus has the key {arguments.key!r}.{hint} `mobee topic schema` lists all keys", BAD_INPUT)
    print(json.dumps(found, indent=2))
    return OK


_Run = Callable[[Any, argparse.Namespace], int]
_ACTIONS: dict[str, tuple[str, Callable[[argparse.ArgumentParser], None], _Run]] = {
    "list": ("list all keys with type, rate and size", _add_list, _list),
    "echo": ("print every message on a key, one line of JSON each", _add_echo, _echo),
    "hz": ("measure rate, period and jitter of the messages on a key", _add_hz, _hz),
    "schema": ("print the JSON schemas of the messages on a key", _add_schema, _schema),
}
