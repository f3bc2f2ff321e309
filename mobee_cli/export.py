"""`mobee export`: the transitions of a run as one table, for other programs."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from experiments.kit.learning.recorded_transitions import records
from mobee.errors import MobeeError
from mobee_cli.errors import UserError
from mobee_cli.reach_learned import write_reaches
from mobee_cli.transition_tables import write_csv, write_parquet
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT

_NOTES = """Columns: source (file in the run), agent, n (1, 2, ... of this agent), s, a,
s_next (state, action, state reached), reward (nats), settled, duration (s),
q (rad, all motors of the part), touched (names of objects), time (s since
1970). Cells of a sweep keep the first six. A Parquet file holds all settings in
its metadata, as JSON under "mobee". With --reaches: where the target is (m, root
frame), then the steps as docs/reaching.md says."""
_IN_THE_RUN = Path()


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Run and file."""
    parser.epilog = _NOTES
    parser.add_argument("run", type=Path, metavar="RUN", help="folder of a run of `mobee launch` or `mobee experiment`")
    kinds = parser.add_mutually_exclusive_group()
    text = "{} (default FILE: transitions.{} in the run's folder)"
    kinds.add_argument("--csv", nargs="?", type=Path, const=_IN_THE_RUN, metavar="FILE", help=text.format("write CSV, the default", "csv"))
    kinds.add_argument("--parquet", nargs="?", type=Path, const=_IN_THE_RUN, metavar="FILE", help=text.format("write Parquet", "parquet"))
    kinds.add_argument(
        "--reaches", nargs="?", type=Path, const=_IN_THE_RUN, metavar="FILE", help="write the steps of problem-tries, as CSV (reaches.csv)"
    )
    parser.add_argument("--json", action="store_true", help="print what was written as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Write the table."""
    if not arguments.run.is_dir():
        raise UserError(f"{arguments.run}: there is no such folder; give that of a run, as in runs/", BAD_INPUT)
    file: Path = arguments.parquet or arguments.csv or arguments.reaches or _IN_THE_RUN
    kind = "parquet" if arguments.parquet is not None else "csv"
    what = "transitions" if arguments.reaches is None else "reaches"
    if file == _IN_THE_RUN:
        file = arguments.run / f"{what}.{kind}"
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
