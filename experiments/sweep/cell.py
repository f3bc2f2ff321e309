"""One independent run of a sweep, and what came of it."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from mobee.errors import InvalidValue

_SAFE = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+=-]{0,119}")


@dataclass(frozen=True)
class Cell:
    """What decides a run: the same cell gives the same values on any machine.

    `name`: unique in its sweep and safe as a file's name, as "lattice-g0.9-50-50-s3".  `settings`: JSON values.
    `cost`: how long it takes beside the others, in any unit; it orders the sweep and tells the time left.
    """

    name: str
    seed: int
    settings: dict[str, Any] = field(default_factory=dict)
    cost: float = 1.0

    def __post_init__(self) -> None:
        if not _SAFE.fullmatch(self.name):
            raise InvalidValue(
                f"cell {self.name!r}: a name has up to 120 letters, digits and any of . _ + = -, and begins with one of the first."
            )
        if not self.cost > 0.0:
            raise InvalidValue(f"cell {self.name!r} costs {self.cost!r}: must be above 0")


Work = Callable[[Cell], dict[str, Any]]


@dataclass(frozen=True)
class CellResult:
    """A finished cell on disk; its values are read when they are first asked for."""

    cell: Cell
    seconds: float
    """How long the work took."""
    path: Path

    @cached_property
    def values(self) -> dict[str, Any]:
        """What the work returned: JSON values and arrays."""
        from experiments.sweep.cell_files import read_values

        return read_values(self.path)
