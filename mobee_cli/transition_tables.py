"""Writes transitions as CSV or Parquet, whole or not at all."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from experiments.kit.learning.recorded_transitions import Record
from mobee_cli.errors import UserError
from services.common.exit_codes import ENVIRONMENT

COLUMNS = ("source", "agent", "n", "s", "a", "s_next", "reward", "settled", "duration", "q", "touched", "time")


def write_csv(file: Path, records: Iterable[Record]) -> int:
    """Write one line a transition, lists as JSON, nothing where a record has no such column; returns how many lines."""
    rows = 0
    with written_whole(file) as unfinished, unfinished.open("w", newline="") as sink:
        lines = csv.writer(sink)
        lines.writerow(COLUMNS)
        for record in records:
            columns = [[_text(value) for value in column] for column in _columns(record)]
            lines.writerows(zip(*columns, strict=True))
            rows += len(columns[0])
    return rows


def write_parquet(file: Path, records: Iterable[Record]) -> int:
    """Write one row a transition, a row group an agent, and all settings as JSON in the metadata; returns how many rows."""
    try:
        import pyarrow as arrow
        from pyarrow import parquet
    except ModuleNotFoundError:
        raise UserError('Parquet needs pyarrow: pip install "mobee[parquet]"; or leave --parquet out', ENVIRONMENT) from None
    name, whole, real = arrow.dictionary(arrow.int32(), arrow.string()), arrow.int32(), arrow.float64()
    kinds = (name, name, whole, whole, whole, whole, real, arrow.bool_(), real, arrow.list_(real), arrow.list_(arrow.string()), real)
    schema = arrow.schema(list(zip(COLUMNS, kinds, strict=True)))
    rows, settings = 0, []
    with written_whole(file) as unfinished, parquet.ParquetWriter(unfinished, schema) as sink:
        for record in records:
            columns = [arrow.array(column, kind) for column, kind in zip(_columns(record), kinds, strict=True)]
            sink.write_table(arrow.Table.from_arrays(columns, schema=schema))
            rows += len(columns[0])
            settings.append({"source": record.source, "agent": record.agent, "settings": record.settings})
        sink.add_key_value_metadata({"mobee": json.dumps(settings)})
    return rows


def _columns(record: Record) -> list[list[Any]]:
    length = len(record.columns["n"])
    same = {"source": [record.source] * length, "agent": [record.agent] * length}
    return [(same | record.columns).get(name, [None] * length) for name in COLUMNS]


def _text(value: Any) -> Any:
    return json.dumps(value) if isinstance(value, bool | tuple) else value


@contextmanager
def written_whole(file: Path) -> Iterator[Path]:
    """A name to write to, which becomes the file's when all is written."""
    unfinished = file.with_name(f"{file.name}.unfinished")
    try:
        yield unfinished
        unfinished.replace(file)
    finally:
        unfinished.unlink(missing_ok=True)
