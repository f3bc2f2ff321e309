# SPDX-License-Identifier: Apache-2.0
"""Cells: the independent runs of a sweep, and their results on disk, one .npz file for each; an interruption leaves no incomplete file."""

from __future__ import annotations

import json
import os
import re
import tempfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue

_SAFE = re.compile(r"[A-Za-z0-9][A-Za-z0-9._+=-]{0,119}")


@dataclass(frozen=True)
class Cell:
    """The settings and the seed of one run: the same cell gives the same values on any machine.

    `name`: unique in its sweep and safe as a file's name, as "lattice-g0.9-50-50-s3".  `settings`: JSON values by name.  `cost`: expected
    duration relative to the other cells, in any unit; the longest cells run first, and the remaining time is predicted from the costs.
    """

    name: str
    seed: int
    settings: dict[str, Any] = field(default_factory=dict)
    cost: float = 1.0

    def __post_init__(self) -> None:
        if not _SAFE.fullmatch(self.name):
            raise InvalidValue(
                f"cell {self.name!r}: a name has up to 120 letters, digits and any of . _ + = -, and begins with a letter or a digit."
            )
        if not self.cost > 0.0:
            raise InvalidValue(f"cell {self.name!r} costs {self.cost!r}: must be above 0")


Work = Callable[[Cell], dict[str, Any]]


@dataclass(frozen=True)
class CellResult:
    """The result of a finished cell (one run of a sweep), read from its .npz file.

    `cell`: settings and seed of the run.  `path`: the file; `values` reads it at the first access.
    """

    cell: Cell
    seconds: float
    """Duration of the run, s."""
    path: Path

    @cached_property
    def values(self) -> dict[str, Any]:
        """The values that the run returned, by name: JSON values and arrays."""
        return read_values(self.path)


FOLDER = "cells"
CELL_FILES = (f"{FOLDER}/*.npz",)
"""Glob patterns that match the files of the finished cells in the folder of a run."""
_RECORD, _ARRAY = "record", "array."  # names in the archive: of the JSON text, and the prefix of the arrays
_DAMAGE = (OSError, KeyError, TypeError, ValueError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error)  # of reading a damaged file


def write_cell(folder: Path, cell: Cell, values: dict[str, Any], seconds: float) -> None:
    """Write the values of a cell to `folder`/cells/<name>.npz; an interruption leaves no incomplete file of this name.

    `folder`: folder of the run.  `values`: what the cell's run returned, by name.  `seconds`: duration of the cell's run.  Raises
    InvalidValue for a value that is neither JSON nor an array of numbers or text, and OSError if the file cannot be written.
    """
    arrays = {key: value for key, value in values.items() if isinstance(value, np.ndarray)}
    record = {"cell": asdict(cell), "seconds": seconds, "values": {key: value for key, value in values.items() if key not in arrays}}
    for key, array in arrays.items():
        if array.dtype.hasobject:
            raise InvalidValue(f"the array {key!r} of cell {cell.name} holds Python objects: give numbers or text.")
    path = cell_path(folder, cell.name)
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".unfinished")
    with unfinished.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **{_RECORD: _bytes(cell, record), **{_ARRAY + k: a for k, a in arrays.items()}})
        file.flush()
        os.fsync(file.fileno())
    unfinished.replace(path)


def cell_path(folder: Path, name: str) -> Path:
    """Return the path of the file of a finished cell.

    `folder`: folder of the run of the whole sweep.  `name`: name of the cell.
    """
    return folder / FOLDER / f"{name}.npz"


def load_cells(folder: Path) -> dict[str, CellResult]:
    """Return the finished cells in the folder of a run, by name and sorted by name; raises InvalidValue for a damaged file."""
    return {path.stem: read_cell(path) for path in sorted((folder / FOLDER).glob("*.npz"))}


@contextmanager
def reduced_cells(folder: Path, summary: Callable[[dict[str, Any]], dict[str, Any]]) -> Iterator[Path]:
    """Yield a temporary folder with the finished cells (trials with one condition and one seed) of a run, with reduced values.

    A context manager: the temporary folder is removed at the end.  `folder`: folder of the run.  `summary`: function that gets the values
    of a cell and returns the reduced values, which are written in their place.
    """
    with tempfile.TemporaryDirectory(prefix="mobee-cells-") as reduced:
        for one in load_cells(folder).values():
            write_cell(Path(reduced), one.cell, summary(one.values), one.seconds)
        yield Path(reduced)


def read_cell(path: Path) -> CellResult:
    """Read a finished cell from its file, without its values, which are read at the first access to `CellResult.values`."""
    return _read(path, arrays=False)[0]


def read_values(path: Path) -> dict[str, Any]:
    """Read the values of a finished cell from its file: JSON values and arrays, by name."""
    return _read(path, arrays=True)[1]


def _read(path: Path, arrays: bool) -> tuple[CellResult, dict[str, Any]]:
    try:
        with np.load(path, allow_pickle=False) as archive:
            record = json.loads(archive[_RECORD].tobytes())
            cell = Cell(**record["cell"])
            if cell.name != path.stem:
                raise InvalidValue(f"it holds the cell {cell.name}")
            names = [name for name in archive.files if arrays and name.startswith(_ARRAY)]
            found = {name.removeprefix(_ARRAY): archive[name] for name in names}
            return CellResult(cell, record["seconds"], path), {**record["values"], **found}
    except _DAMAGE as error:
        raise InvalidValue(f"{path} is not a finished cell ({error}): delete it, and the run will repeat the cell.") from None


def _bytes(cell: Cell, record: dict[str, Any]) -> Array:
    try:
        text = json.dumps(record, default=_plain)
    except (TypeError, ValueError) as error:
        raise InvalidValue(f"cell {cell.name}: {error}; valid are JSON values, and arrays as values of the dict itself.") from None
    return np.frombuffer(text.encode(), dtype=np.uint8)


def _plain(value: object) -> Any:
    """Convert NumPy scalars to JSON values."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{value!r} of type {type(value).__name__} is no JSON value")
