"""Records of a run, appended one by one, so that nothing finished is lost."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TextIO


class Records:
    """A CSV file with a head line; each record is in it when `append` returns.  What a kill has cut is taken off."""

    def __init__(self, path: Path, columns: tuple[str, ...]) -> None:
        self.path, self.columns = path, columns
        self._file = path.open("a+", newline="")
        self._file.truncate(_whole(self._file))
        self._writer = csv.DictWriter(self._file, columns)

    def append(self, record: Mapping[str, object]) -> None:
        """Write one record, with all columns; the first brings the head line."""
        if self._file.tell() == 0:
            self._writer.writeheader()
        self._writer.writerow(record)
        self._file.flush()

    def __enter__(self) -> Records:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._file.close()


def read_records(path: Path, columns: tuple[str, ...]) -> list[dict[str, str]]:
    """All whole records; [] if there is no file.  A last line that a kill has cut is dropped."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        length = _whole(file)
        file.seek(0)
        rows = list(csv.DictReader(file.read(length).splitlines()))
    return [{column: row[column] for column in columns} for row in rows]


def _whole(file: TextIO) -> int:
    """Length of the whole lines of an ASCII file, which is left at their end."""
    file.seek(0)
    length = file.read().rfind("\n") + 1
    file.seek(length)
    return length


@dataclass(frozen=True, slots=True)
class Row:
    """A record as a dataclass, to be derived from: its fields are texts, floats and booleans."""

    @classmethod
    def columns(cls) -> tuple[str, ...]:
        """Of the file."""
        return tuple(field.name for field in fields(cls))

    def record(self) -> dict[str, object]:
        """For the file, or as the values of a cell; numbers to six places."""
        values = {name: getattr(self, name) for name in self.columns()}
        return {name: round(value, 6) if isinstance(value, float) else value for name, value in values.items()}

    @classmethod
    def of_record(cls, row: Mapping[str, str]) -> Self:
        """From the file."""
        read: dict[str, Any] = {"float": float, "bool": "True".__eq__, "str": str}
        return cls(**{field.name: read[str(field.type)](row[field.name]) for field in fields(cls)})
