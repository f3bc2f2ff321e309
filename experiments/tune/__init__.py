"""The search that tuned `Gains.default()`.

Claim: no gains that a seeded search finds are clearly better than `Gains.default()` by the criteria of `criteria.py`: settling
time, overshoot, solids that touch while the hands press 5 to 25 cm into the table, while a client pushes and while the robot
wanders between random postures, chatter at the table with commands one, three and four ticks old at 100 Hz, violated constraints.
Source: this project's goals for MoBeE 2.0 (thesis 5.2).  Published number: none, the thesis has no criteria.  Run time: half an
hour for 100 gain sets.

The first set judged is `Gains.default()` itself.  Each of the others changes a few numbers of the best so far by random factors, which
grow after a success and shrink after a failure.  The result is a table of both, and the numbers of the best.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from experiments.kit.options import positive_whole
from experiments.kit.progress import Progress
from experiments.kit.records import Records, read_records
from experiments.tune.figure import draw
from experiments.tune.search import COLUMNS, Tried, search

NAME = "tune"
CLAIM = "a seeded search finds no gains that are clearly better than the default ones"
SOURCE = "thesis 5.2; this project's criteria"

RECORDS = "tune.csv"
CLEARLY = 0.8  # of the default's objective: what is less is clearly better


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--sets", type=positive_whole, default=100, metavar="N", help="gain sets to judge (default: 100)")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Search, going on behind what is in the folder."""
    path = folder / RECORDS
    tried = read_tried(path)
    with Records(path, COLUMNS) as records, Progress() as progress:
        for new in search(tried, arguments.sets, arguments.seed):
            records.append(new.record())
            best = min(known.objective for known in tried)
            progress.show(len(tried) / arguments.sets, f"{len(tried)} gain sets, objective {tried[0].objective:.2f} -> {best:.2f}")
    return results(tried)


def read_tried(path: Path) -> list[Tried]:
    """What a run has so far."""
    return [Tried.of_record(row) for row in read_records(path, COLUMNS)]


def results(tried: list[Tried]) -> dict[str, Any]:
    """The default and the best, side by side."""
    before, best = tried[0], min(tried, key=lambda one: one.objective)
    criteria = {name: [round(value, 4), round(asdict(best.judged)[name], 4)] for name, value in asdict(before.judged).items()}
    return {
        "passed": best.objective >= CLEARLY * before.objective,
        "judged": len(tried),
        "objective": [round(before.objective, 3), round(best.objective, 3)],
        "each": "Gains.default() and the best",
        "criteria": criteria,
        "gains": {name: [round(value, 4), round(best.numbers[name], 4)] for name, value in before.numbers.items()},
    }


def figure(folder: Path) -> Path:
    """The course of the search, and every number of the better sets."""
    return draw(read_tried(folder / RECORDS), folder / "tune.png")
