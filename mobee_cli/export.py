# SPDX-License-Identifier: Apache-2.0
"""`mobee export`: writes the transitions of a run as one table, for other programs."""

from __future__ import annotations

import argparse
import csv
import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import astuple
from pathlib import Path
from typing import Any

from experiments.kit.learning.exploration import Record, records, stores_of
from mobee.errors import MobeeError
from mobee.learning.reaching.store import COLUMNS as STEP_COLUMNS
from mobee.learning.reaching.store import ReachStore, reaching_parts
from mobee.store import STORE
from mobee_cli.errors import UserError
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT

COLUMNS = ("source", "agent", "n", "s", "a", "s_next", "reward", "settled", "duration", "q", "touched", "time")
REACH_COLUMNS = ("source", "part", "x", "y", "z", *STEP_COLUMNS, "time")
_NOTES = """Columns: source (file in the run), agent, n (1, 2, ... of this agent), s, a,
s_next (state, action, state reached), reward (nats), settled, duration (s),
q (rad, all motors of the part), touched (names of objects), time (s since
1970). Trials of experiments have the first six only. A Parquet file holds all
settings in its metadata, as JSON under "mobee". With --reaches: the position of
the target (m, root frame), then the columns described in docs/reaching.md."""
_IN_THE_RUN = Path()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee export` to the parser: the recorded run, and kind and name of the file to write."""
    parser.epilog = _NOTES
    parser.add_argument(
        "run", type=Path, metavar="RUN", help=f"folder of a run of `mobee launch` or `mobee experiment`, or a file such as {STORE}"
    )
    kinds = parser.add_mutually_exclusive_group()
    text = "{} (default FILE: transitions.{} in the run's folder)"
    kinds.add_argument("--csv", nargs="?", type=Path, const=_IN_THE_RUN, metavar="FILE", help=text.format("write CSV, the default", "csv"))
    kinds.add_argument("--parquet", nargs="?", type=Path, const=_IN_THE_RUN, metavar="FILE", help=text.format("write Parquet", "parquet"))
    kinds.add_argument(
        "--reaches",
        nargs="?",
        type=Path,
        const=_IN_THE_RUN,
        metavar="FILE",
        help="write the steps of reaches as CSV (default FILE: reaches.csv)",
    )
    parser.add_argument("--json", action="store_true", help="print what was written as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee export`: write a table of the recorded data, print its number of rows, and return the exit code."""
    if not arguments.run.exists():
        raise UserError(f"{arguments.run}: there is no such folder; give the folder of a run, one of those in runs/", BAD_INPUT)
    file: Path = arguments.parquet or arguments.csv or arguments.reaches or _IN_THE_RUN
    kind = "parquet" if arguments.parquet is not None else "csv"
    what = "transitions" if arguments.reaches is None else "reaches"
    if file == _IN_THE_RUN:
        file = (arguments.run if arguments.run.is_dir() else arguments.run.parent) / f"{what}.{kind}"
    _require_no_source(file, arguments.run)
    try:
        if arguments.reaches is not None:
            rows = write_reaches(file, arguments.run)
        else:
            rows = (write_csv if kind == "csv" else write_parquet)(file, records(arguments.run))
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None
    except OSError as error:
        raise UserError(f"{file} cannot be written: {error.strerror or error}", ENVIRONMENT) from None
    unit = "transitions" if arguments.reaches is None else "steps"
    print(json.dumps({"file": str(file), unit: rows}) if arguments.json else f"{file}: {rows} {unit}")
    return 0


def _require_no_source(file: Path, run: Path) -> None:
    """Raise UserError if the file to write is one of those that are read, or has the ending of such a file."""
    is_read = file.exists() and any(file.samefile(source) for source, _ in stores_of(run))
    if is_read or file.suffix.lower() in (".sqlite", ".npz"):
        raise UserError(f"{file}: the table must not replace the data of a run: give a file whose name ends in .csv or .parquet", BAD_INPUT)


def write_csv(file: Path, records: Iterable[Record]) -> int:
    """Write transitions as CSV, one line for each, and return the number of lines.

    `records`: each contains the transitions of one agent. Lists are written as JSON; a cell is empty if a record lacks this column.
    """
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
    """Write transitions as Parquet, and return the number of rows.

    Each record (the transitions of one agent) is a row group. The settings of all agents are JSON in the metadata of the file. Raises
    UserError if pyarrow is not installed.
    """
    try:
        import pyarrow as arrow
        from pyarrow import parquet
    except ModuleNotFoundError:
        raise UserError('Parquet needs pyarrow: pip install "mobee[parquet]"; or omit --parquet', ENVIRONMENT) from None
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
    """Yield a temporary path for the block of a `with` statement.

    If the block succeeds, the file at this path is renamed to `file`; else it is removed.
    """
    unfinished = file.with_name(f"{file.name}.unfinished")
    try:
        yield unfinished
        unfinished.replace(file)
    finally:
        unfinished.unlink(missing_ok=True)


def write_reaches(file: Path, folder: Path) -> int:
    """Write the attempts of agents to reach targets as CSV, with one line for each step of an attempt; return the number of lines.

    `folder`: the folder of the run, which has the recorded attempts. Raises MobeeError if it has none.
    """
    rows = 0
    with written_whole(file) as unfinished, unfinished.open("w", newline="") as sink:
        lines = csv.writer(sink)
        lines.writerow(REACH_COLUMNS)
        for source, name in stores_of(folder):
            for part in reaching_parts(source):
                with ReachStore(source, part, read_only=True) as store:
                    targets = [target.position.tolist() for target in store.problems()]
                    for step, time in zip(store.load(), store.times(), strict=True):
                        values = (json.dumps(value) if isinstance(value, bool | tuple) else value for value in astuple(step))
                        lines.writerow((name, part, *targets[step.problem], *values, time))
                        rows += 1
        if not rows:
            raise MobeeError(f"{folder}: no agent has learned to reach in this run.")
    return rows
