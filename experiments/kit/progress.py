"""One line that tells a waiting person how far it is; nothing in a pipe."""

from __future__ import annotations

import sys
import time
from types import TracebackType

WIDTH = 24
PERIOD = 0.1  # s between two drawings


class Progress:
    """A bar on standard error, if that is a terminal."""

    def __init__(self) -> None:
        self._is_shown = sys.stderr.isatty()
        self._next = 0.0

    def show(self, fraction: float, text: str) -> None:
        """Say that this fraction 0..1 is done; cheap, most calls draw nothing."""
        now = time.monotonic()
        if not self._is_shown or now < self._next:
            return
        self._next = now + PERIOD
        full = round(WIDTH * min(max(fraction, 0.0), 1.0))
        print(f"\r\x1b[K[{'#' * full}{'.' * (WIDTH - full)}] {text}", end="", file=sys.stderr, flush=True)

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        if self._is_shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
