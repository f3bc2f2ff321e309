"""Records of a run, appended one by one, so that nothing finished is lost."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType


class Records:
    """A CSV file with a head line; each record is on disk when `append` returns."""

    def __init__(self, path: Path, columns: tuple[str, ...]) -> None:
        self.path, self.columns = path, columns
        is_new = not path.exists()
        self._file = path.open("a", newline="")
        self._writer = csv.DictWriter(self._file, columns)
        if is_new:
            self._writer.writeheader()

    def append(self, record: Mapping[str, object]) -> None:
        """Write one record, with all columns."""
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
        text = file.read()
    whole = text[: text.rfind("\n") + 1]
    return [row for row in csv.DictReader(whole.splitlines()) if all(row.get(column) not in (None, "") for column in columns)]
