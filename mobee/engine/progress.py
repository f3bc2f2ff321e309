"""Says how far the compilation of the engine is: on a terminal in one line that counts, in a file in a line every few seconds."""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any

from numba.core import event

from mobee.engine.cache import compiled_sources

PERIOD = 10.0  # s between lines where they stay

_DECORATED = re.compile(r"^@(?:inner|inlined|entry)", re.MULTILINE)
_events: Any = event  # Numba's type information ends here


class Progress(event.Listener):
    """Counts what Numba compiles between `with` and its end; says nothing where that is nothing."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._total = self._done = 0
        self._on_terminal = sys.stderr.isatty()
        self._begin = self._said = time.perf_counter()

    def __enter__(self) -> Progress:
        _events.register("numba:compile", self)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        _events.unregister("numba:compile", self)
        if self._total == 0:
            return
        if self._on_terminal:
            sys.stderr.write("\r\033[K")
        if kind is None:
            say(f"the engine is compiled, {self._seconds():.0f} s.")
        elif kind is KeyboardInterrupt:
            say("interrupted; what is compiled so far is kept.")

    def on_start(self, event: Any) -> None:
        """A function begins."""
        if self._total > 0:
            return
        self._total = sum(len(_DECORATED.findall(file.read_text())) for file in compiled_sources())
        say(f"compiling the engine into {self._folder}, once after an install or an edit: about a minute ...")

    def on_end(self, event: Any) -> None:
        """A function is compiled."""
        self._done += event.data["dispatcher"].py_func.__module__.startswith("mobee.")  # it compiles some of its own, too
        text = f"{self._done} of about {self._total} functions, {self._seconds():.0f} s"
        if self._on_terminal:
            sys.stderr.write(f"\r\033[Kmobee: {text}")
            sys.stderr.flush()
        elif time.perf_counter() - self._said > PERIOD:
            self._said = time.perf_counter()
            say(text)

    def _seconds(self) -> float:
        return time.perf_counter() - self._begin


def say(what: str) -> None:
    """Print a line for who waits."""
    print(f"mobee: {what}", file=sys.stderr, flush=True)
