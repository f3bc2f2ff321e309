"""Work off what a sweep has not done yet."""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from experiments.progress import Progress
from experiments.sweep.cell import Cell, Work
from experiments.sweep.cell_files import cell_path, load_cells, write_cell
from experiments.sweep.done import Done
from experiments.sweep.processes import in_processes
from experiments.sweep.ray_cluster import on_ray
from experiments.sweep.time_left import TimeLeft
from mobee.errors import InvalidValue, MobeeError

Engine = Callable[[Work, Sequence[Cell], int | None], Iterator[Done]]
_ENGINES: dict[str, Engine] = {"processes": in_processes, "ray": on_ray}

LISTED = 3  # failed cells that are named; the folder has all


class CellsFailed(MobeeError):
    """Raised at the end of a sweep in which cells failed; the others are finished and on disk."""


def run_cells(work: Work, cells: Sequence[Cell], folder: Path, arguments: argparse.Namespace) -> None:
    """Work off the cells that `folder` does not hold yet; each is on disk as soon as it is finished.

    `work` is a function of a module, so that other processes find it; it returns a dict of JSON values and arrays, which its cell
    alone decides.  A kill loses at most the cells under way.

    Raises:
        InvalidValue: two cells have one name, or the folder holds a cell of that name with other settings.
        CellsFailed: with the names of the first; what went wrong is in `folder`/cells/<name>.failed.txt.
    """
    _require_distinct(cells)
    left = _missing(cells, folder)
    failed: dict[str, str] = {}
    time_left = TimeLeft([cell.cost for cell in cells], [cell.cost for cell in left], time.monotonic())
    with Progress() as progress:
        progress.show(time_left.fraction, f"{len(cells) - len(left)} of {len(cells)}")
        for number, done in enumerate(_ENGINES[arguments.engine](work, left, arguments.jobs) if left else (), len(cells) - len(left) + 1):
            failure = _keep(done, folder)
            if failure:
                failed[done.cell.name] = failure
            time_left.finished(done.cell.cost, time.monotonic())
            progress.show(time_left.fraction, f"{number} of {len(cells)}, {time_left}" + (f", {len(failed)} failed" if failed else ""))
    if failed:
        listed = "\n".join(f"  {name}: {reason}" for name, reason in list(failed.items())[:LISTED])
        listed += f"\n  and {len(failed) - LISTED} more" if len(failed) > LISTED else ""
        raise CellsFailed(
            f"{len(failed)} of {len(cells)} cells failed, the others are finished (see {folder}/cells/*.failed.txt):\n{listed}"
        )


def _keep(done: Done, folder: Path) -> str:
    """Write a cell; returns why it failed, "" if it did not."""
    report = cell_path(folder, done.cell.name).with_suffix(".failed.txt")
    error, reason = done.error, done.reason
    if done.values is not None:
        try:
            write_cell(folder, done.cell, done.values, done.seconds)
            report.unlink(missing_ok=True)
            return ""
        except InvalidValue as wrong:
            error = reason = str(wrong)
    report.parent.mkdir(parents=True, exist_ok=True)
    report.write_text(error + "\n")
    return reason


def _require_distinct(cells: Sequence[Cell]) -> None:
    repeated = [name for name, count in Counter(cell.name for cell in cells).items() if count > 1]
    if repeated:
        raise InvalidValue(f"several cells are named {repeated[0]!r}: put what they differ in into their names.")


def _missing(cells: Sequence[Cell], folder: Path) -> list[Cell]:
    """What is not done yet, the costly first, so that no core waits long for the last."""
    done = load_cells(folder)
    for cell in cells:
        if cell.name in done and _decided_by(cell) != _decided_by(done[cell.name].cell):
            raise InvalidValue(f"{folder} holds the cell {cell.name} with other settings: begin a new run without --resume.")
    return sorted((cell for cell in cells if cell.name not in done), key=lambda cell: -cell.cost)


def _decided_by(cell: Cell) -> tuple[int, object]:
    return cell.seed, json.loads(json.dumps(cell.settings))  # as the disk has it: tuples are lists
