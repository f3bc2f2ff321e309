"""`mobee export`: the transitions of a run as one table, for other programs."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from experiments.recorded_transitions import records
from mobee.errors import MobeeError
from mobee_cli.errors import BAD_INPUT, ENVIRONMENT, UserError
from mobee_cli.transition_tables import write_csv, write_parquet

_NOTES = """Columns: source (file in the run), agent, n (1, 2, ... of this agent), s, a,
s_next (state, action, state reached), reward (nats), settled, duration (s),
q (rad, all motors of the part), touched (names of objects), time (s since
1970). Cells of a sweep keep the first six. A Parquet file holds all settings in
its metadata, as JSON under "mobee"."""
_IN_THE_RUN = Path()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Run and file."""
    parser.epilog = _NOTES
    parser.add_argument("run", type=Path, metavar="RUN", help="folder of a run of `mobee launch` or `mobee experiment`")
    kinds = parser.add_mutually_exclusive_group()
    text = "{} (default FILE: transitions.{} in the run's folder)"
    kinds.add_argument("--csv", nargs="?", type=Path, const=_IN_THE_RUN, metavar="FILE", help=text.format("write CSV, the default", "csv"))
    kinds.add_argument("--parquet", nargs="?", type=Path, const=_IN_THE_RUN, metavar="FILE", help=text.format("write Parquet", "parquet"))
    parser.add_argument("--json", action="store_true", help="print what was written as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Write the table."""
    if not arguments.run.is_dir():
        raise UserError(f"{arguments.run}: there is no such folder; give that of a run, as in runs/", BAD_INPUT)
    write, kind = (write_csv, "csv") if arguments.parquet is None else (write_parquet, "parquet")
    file: Path = arguments.parquet or arguments.csv or _IN_THE_RUN
    if file == _IN_THE_RUN:
        file = arguments.run / f"transitions.{kind}"
    try:
        rows = write(file, records(arguments.run))
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None
    except OSError as error:
        raise UserError(f"{file} cannot be written: {error.strerror or error}", ENVIRONMENT) from None
    print(json.dumps({"file": str(file), "transitions": rows}) if arguments.json else f"{file}: {rows} transitions")
    return 0
