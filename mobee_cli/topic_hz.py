"""`mobee topic hz`: rate, period and jitter of a key, as messages arrive here."""

from __future__ import annotations

import argparse
import json
import statistics
import time
from typing import Any

from services.common.exit_codes import FAILED
from services.common.observe import listen

_WINDOW = 1.0  # s


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Key and options."""
    parser.add_argument("key", help="key expression, for example clock or left_arm/state")
    parser.add_argument("--duration", type=float, default=float("inf"), metavar="S", help="end after so many seconds")
    parser.add_argument("--json", action="store_true", help="one JSON object a line")


def run(session: Any, arguments: argparse.Namespace) -> int:
    """Print a line a second; exit code 1 when nothing came."""
    times: list[float] = []
    listen(session, arguments.key, lambda heard: times.append(heard.at))
    end, seen, came = time.monotonic() + arguments.duration, 0, False
    while time.monotonic() < end:
        time.sleep(max(0.0, min(_WINDOW, end - time.monotonic())))
        window = times[max(0, seen - 1) :]  # with the last one before, to whom the first period belongs
        seen += len(window) - (1 if seen else 0)
        came = came or seen > 0
        figures = _figures(window)
        print(json.dumps(figures) if arguments.json else _as_text(figures), flush=True)
    return 0 if came else FAILED


def _figures(times: list[float]) -> dict[str, float | int | None]:
    """Rate in Hz; periods and their standard deviation (jitter) in s; None with fewer than two messages."""
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
