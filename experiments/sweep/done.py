"""What an engine tells about a cell it has dealt with."""

from __future__ import annotations

import time
import traceback
from dataclasses import dataclass
from typing import Any

from experiments.sweep.cell import Cell, Work


@dataclass(frozen=True)
class Done:
    """A cell that was worked off: its values, or what went wrong."""

    cell: Cell
    seconds: float
    values: dict[str, Any] | None
    error: str = ""  # a traceback, or how its process died

    @property
    def reason(self) -> str:
        """The last line of the error."""
        return self.error.strip().rpartition("\n")[2]


def do(work: Work, cell: Cell) -> Done:
    """Work a cell off, whatever happens."""
    start = time.monotonic()
    try:
        values = work(cell)
    except Exception:  # of the experiment's own code: it is reported with the cell's name, and the others go on
        return Done(cell, time.monotonic() - start, None, traceback.format_exc())
    return Done(cell, time.monotonic() - start, values)
