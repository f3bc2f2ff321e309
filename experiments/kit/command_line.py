# SPDX-License-Identifier: Apache-2.0
"""Command line of experiments and benchmarks: types of options, and a progress bar."""

from __future__ import annotations

import argparse
import math
import sys
import time
from types import TracebackType


def positive_whole(text: str) -> int:
    """Parse a whole number of 1 or more."""
    if not (text.isascii() and text.isdecimal() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive whole number")
    return int(text)


def whole_from_two(text: str) -> int:
    """Parse a whole number of 2 or more."""
    number = positive_whole(text)
    if number < 2:
        raise argparse.ArgumentTypeError(f"{text!r} is less than 2")
    return number


def positive_number(text: str) -> float:
    """Parse a finite number above 0."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive number")
    return number


WIDTH = 24
PERIOD = 0.1  # s between two drawings


class Progress:
    """A progress bar on standard error, if that is a terminal; otherwise nothing is printed."""

    def __init__(self) -> None:
        self._is_shown = sys.stderr.isatty()
        self._next = 0.0

    def show(self, fraction: float, text: str) -> None:
        """Show a fraction 0..1 and a text; at most one drawing each PERIOD, so it can be called often."""
        now = time.monotonic()
        if not self._is_shown or now < self._next:
            return
        self._next = now + PERIOD
        full = round(WIDTH * min(max(fraction, 0.0), 1.0))
        print(f"\r\x1b[K[{'#' * full}{'.' * (WIDTH - full)}] {text}", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Erase the bar until the next drawing, so that a line can be printed."""
        if self._is_shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.clear()
