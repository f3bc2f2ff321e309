# SPDX-License-Identifier: Apache-2.0
"""Command line of experiments and benchmarks: types of options, and a progress bar."""

from __future__ import annotations

import argparse
import math
import sys
import time
from types import TracebackType


def whole(text: str) -> int:
    """Return the whole number of 0 or more that `text` states; raises argparse.ArgumentTypeError for any other text."""
    if not (text.isascii() and text.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number of 0 or more")
    return int(text)


def positive_whole(text: str) -> int:
    """Return the whole number of 1 or more that `text` states; raises argparse.ArgumentTypeError for any other text."""
    if not (text.isascii() and text.isdecimal() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text!r} is not a positive whole number")
    return int(text)


def whole_from_two(text: str) -> int:
    """Return the whole number of 2 or more that `text` states; raises argparse.ArgumentTypeError for any other text."""
    number = positive_whole(text)
    if number < 2:
        raise argparse.ArgumentTypeError(f"{text!r} is less than 2")
    return number


def positive_number(text: str) -> float:
    """Return the finite number above 0 that `text` states; raises argparse.ArgumentTypeError for any other text."""
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
    """A progress bar on standard error, for a `with` statement; nothing is printed if standard error is not a terminal."""

    def __init__(self) -> None:
        self._is_shown = sys.stderr.isatty()
        self._next = 0.0

    def show(self, fraction: float, text: str) -> None:
        """Draw the bar with the finished `fraction`, 0 to 1, and a text after it.

        It may be called often: calls within PERIOD (0.1 s) of the last drawing do nothing.
        """
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
