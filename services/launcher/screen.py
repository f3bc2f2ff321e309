# SPDX-License-Identifier: Apache-2.0
"""Shows the state of the system: as a screen in a terminal, or as lines if the output is not a terminal."""

from __future__ import annotations

import re
import shutil
import sys
import textwrap
import time
from collections.abc import Collection
from pathlib import Path

from services.common.text import printable
from services.launcher.child import Watched

_LOG_LINES = 5  # newest lines on the screen
_COLOURS = {"ready": "32", "fault": "1;31", "failed": "33", "starting": "36"}


class Screen:
    """Writes the state of the system to standard error; standard output is kept for the summary. `title`: name of the system."""

    def __init__(self, title: str) -> None:
        self._title, self._started, self._height = title, time.monotonic(), 0
        self._lines: list[str] = []
        self._terminal = sys.stderr.isatty()

    def add(self, text: str) -> None:
        """Add a line with the present time to the screen. If the output is not a terminal, print it."""
        line = f"{time.strftime('%H:%M:%S')} {printable(text)}"
        self._lines = [*self._lines, line][-_LOG_LINES:]
        if not self._terminal:
            print(line, file=sys.stderr, flush=True)

    def draw(self, children: Collection[Watched], directory: Path, *, last: bool = False) -> None:
        """Draw the screen over the previous one.

        `children`: the services, with their states. `directory`: folder of the run. `last`: no further drawing follows. If the output is
        not a terminal, nothing is drawn.
        """
        if not self._terminal:
            return
        columns, rows = shutil.get_terminal_size()
        lines = [f"mobee: {self._title}   up {_clock(time.monotonic() - self._started)}", f"run    {directory}"]
        lines += [f"page   {page}" if len(page) + 7 < columns else page for page in _pages(children)]  # an address must not be cut
        lines += ["", f"{'service':<16}{'state':<10}{'pid':>8}{'restarts':>10}  status"]
        lines += [_row(child) for child in children]
        added = [line for text in self._lines for line in textwrap.wrap(text, max(1, columns - 1), subsequent_indent=" " * 9)]
        end = [] if last else ["Ctrl-C stops everything."]
        lines = lines[: rows - 1 - len(end)]  # lines that have scrolled away could not be overwritten
        room = rows - 2 - len(end) - len(lines)
        lines += ["", *added[-room:], *end] if room > 0 else end
        text = "".join(f"\x1b[2K{_paint(line[: columns - 1])}\n" for line in lines)
        up = f"\x1b[{self._height}A" if self._height else ""
        sys.stderr.write(f"{up}{text}\x1b[J")
        sys.stderr.flush()
        self._height = len(lines)


def _row(child: Watched) -> str:
    status = child.reason if child.phase in ("failed", "fault") else child.stat.text if child.stat else ""
    if child.host and child.phase not in ("failed", "fault"):
        status = f"on {child.host}: {status}"
    return f"{child.who:<16}{child.phase:<10}{child.pid or '-':>8}{child.restarts:>10}  {printable(' '.join(status.split()))}"


def _pages(children: Collection[Watched]) -> list[str]:
    """Return the addresses of pages in the status lines of services."""
    return [page for child in children if child.stat for page in re.findall(r"https?://\S+", child.stat.text)]


def _paint(line: str) -> str:
    """Return the line with its state in colour; call it after the line was cut to the width of the terminal."""
    state = line[16:26].strip()
    return f"{line[:16]}\x1b[{_COLOURS[state]}m{line[16:26]}\x1b[0m{line[26:]}" if state in _COLOURS else line


def _clock(seconds: float) -> str:
    minutes, seconds = divmod(int(seconds), 60)
    return f"{minutes // 60}:{minutes % 60:02}:{seconds:02}"
