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
    """A CSV file with a header; each record is on disk when `append` returns.  An incomplete last line is removed on opening."""

    def __init__(self, path: Path, columns: tuple[str, ...]) -> None:
        self.path, self.columns = path, columns
        self._file = path.open("a+", newline="")
        self._file.truncate(_whole(self._file))
        self._writer = csv.DictWriter(self._file, columns)

    def append(self, record: Mapping[str, object]) -> None:
        """Write one record with all columns, and the header before the first."""
        if self._file.tell() == 0:
            self._writer.writeheader()
        self._writer.writerow(record)
        self._file.flush()

    def __enter__(self) -> Records:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._file.close()


def read_records(path: Path, columns: tuple[str, ...]) -> list[dict[str, str]]:
    """Return all complete records; [] if there is no file."""
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
    """Return the values of a cell; numbers are rounded to six places."""
    return {name: round(value, 6) if isinstance(value, float) else value for name, value in values.items()}


@dataclass(frozen=True, slots=True)
class Row:
    """Base class of records that are dataclasses with fields of type str, int, float and bool."""

    PLACES: ClassVar[int | None] = 6  # of numbers in the record; None: all digits

    @classmethod
    def columns(cls) -> tuple[str, ...]:
        """Return the column names of the file."""
        return tuple(field.name for field in fields(cls))

    def record(self) -> dict[str, object]:
        """Return the record for the file, in ASCII, or as the values of a cell; numbers are rounded to PLACES."""
        return {name: self._written(getattr(self, name)) for name in self.columns()}

    def _written(self, value: object) -> object:
        if isinstance(value, float) and self.PLACES is not None:
            return round(value, self.PLACES)
        return value.encode("ascii", "backslashreplace").decode() if isinstance(value, str) else value

    @classmethod
    def of_record(cls, row: Mapping[str, str]) -> Self:
        """Return the record read from a row of the file."""
        read: dict[str, Any] = {"float": float, "int": int, "bool": "True".__eq__, "str": str}
        return cls(**{field.name: read[str(field.type)](row[field.name]) for field in fields(cls)})
