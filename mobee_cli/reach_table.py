"""What was learned of reaching, as a table on disk."""

from __future__ import annotations

import csv
import json
from dataclasses import astuple
from pathlib import Path

from mobee.errors import MobeeError
from mobee.learning.reaching.store import COLUMNS, ReachStore, reaching_parts
from mobee_cli.transition_tables import written_whole

HEAD = ("source", "part", "x", "y", "z", *COLUMNS, "time")


def write_reaches(file: Path, folder: Path) -> int:
    """Write one line a step of every problem-try in a run's folder; returns how many.  Raises MobeeError if there are none."""
    rows = 0
    with written_whole(file) as unfinished, unfinished.open("w", newline="") as sink:
        lines = csv.writer(sink)
        lines.writerow(HEAD)
        for source in sorted(folder.rglob("*.sqlite")):
            for part in reaching_parts(source):
                with ReachStore(source, part, read_only=True) as store:
                    targets = [target.position.tolist() for target in store.problems()]
                    for step, time in zip(store.load(), store.times(), strict=True):
                        values = (json.dumps(value) if isinstance(value, bool | tuple) else value for value in astuple(step))
                        lines.writerow((source.relative_to(folder), part, *targets[step.problem], *values, time))
                        rows += 1
        if not rows:
            raise MobeeError(f"{folder}: nobody has learned to reach in this run.")
    return rows
