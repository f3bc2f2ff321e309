# SPDX-License-Identifier: Apache-2.0
"""Records of a run in a CSV file, appended one by one, so that an interruption loses no finished record."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from types import TracebackType
from typing import Any, ClassVar, Self, TextIO


class Records:
    """A CSV file with a header, to which records are appended; each record is written to the file when `append` returns.

    `columns`: names of the columns.  When an existing file is opened, an incomplete last line is removed.
    """

    def __init__(self, path: Path, columns: tuple[str, ...]) -> None:
        self.path, self.columns = path, columns
        self._file = path.open("a+", newline="")
        self._file.truncate(_whole(self._file))
        self._writer = csv.DictWriter(self._file, columns)

    def append(self, record: Mapping[str, object]) -> None:
        """Write one record, a value for each column, and before the first record the header."""
        if self._file.tell() == 0:
            self._writer.writeheader()
        self._writer.writerow(record)
        self._file.flush()

    def __enter__(self) -> Records:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._file.close()


def read_records(path: Path, columns: tuple[str, ...]) -> list[dict[str, str]]:
    """Return all complete records of a CSV file, each as a dict from column name to text, with these columns; [] if there is no file."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        length = _whole(file)
        file.seek(0)
        rows = list(csv.DictReader(file.read(length).splitlines()))
    return [{column: row[column] for column in columns} for row in rows]


def _whole(file: TextIO) -> int:
    """Return the length of the complete lines of an ASCII file, and position the file there."""
    file.seek(0)
    length = file.read().rfind("\n") + 1
    file.seek(length)
    return length


def rounded(**values: Any) -> dict[str, Any]:
    """Return the keyword arguments as a dict, with floats rounded to six decimals: the values that one run of a sweep returns."""
    return {name: round(value, 6) if isinstance(value, float) else value for name, value in values.items()}


@dataclass(frozen=True, slots=True)
class Row:
    """Base class of dataclasses that are records of a CSV file; their fields are of type str, int, float or bool.

    `PLACES`: number of decimals to which floats are rounded in a record; None: they are not rounded.
    """

    PLACES: ClassVar[int | None] = 6  # of numbers in the record; None: all digits

    @classmethod
    def columns(cls) -> tuple[str, ...]:
        """Return the column names of the file, which are the names of the fields."""
        return tuple(field.name for field in fields(cls))

    def record(self) -> dict[str, object]:
        """Return the fields by name, as one record of the file, or as the values of a cell (one run of a sweep).

        Floats are rounded to PLACES decimals, 6 unless a subclass sets another number (None: they are not rounded).  Characters of texts
        that are not ASCII are written as escapes.
        """
        return {name: self._written(getattr(self, name)) for name in self.columns()}

    def _written(self, value: object) -> object:
        if isinstance(value, float) and self.PLACES is not None:
            return round(value, self.PLACES)
        return value.encode("ascii", "backslashreplace").decode() if isinstance(value, str) else value

    @classmethod
    def of_record(cls, row: Mapping[str, str]) -> Self:
        """Return the object that a row of the file describes; `row`: text by column name, as `read_records` returns it."""
        read: dict[str, Any] = {"float": float, "int": int, "bool": "True".__eq__, "str": str}
        return cls(**{field.name: read[str(field.type)](row[field.name]) for field in fields(cls)})
