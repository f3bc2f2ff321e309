# SPDX-License-Identifier: Apache-2.0
"""Sweeps: one trial under each of several conditions with each of several seeds, on all cores or machines."""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from experiments.kit.cells import CELL_FILES, Cell, CellResult, Work, cell_path, load_cells, reduced_cells, write_cell
from experiments.kit.command_line import Progress, positive_whole
from experiments.kit.engines import Done, in_processes, on_ray
from experiments.kit.plots import saved
from experiments.kit.track import FOLDER as TRACK
from experiments.kit.track import track_values, tracked
from mobee.errors import InvalidValue, MobeeError

Engine = Callable[[Work, Sequence[Cell], int | None], Iterator[Done]]
_ENGINES: dict[str, Engine] = {"processes": in_processes, "ray": on_ray}

MAX_LISTED = 3  # failed cells that are named in the message; the folder has all


class CellsFailed(MobeeError):
    """Raised at the end of a sweep in which cells (trials with one condition and seed) failed; all other cells are finished and on disk."""


class Condition(NamedTuple):
    """One combination of settings in a sweep, with which a trial is run for each seed.

    `name`: unique in its sweep and safe as a file's name.  `settings`: JSON values by name.  `cost`: expected duration of a trial relative
    to the others, in any unit.  `seeds`: seeds of this condition; (): those that the options of the run name.
    """

    name: str
    settings: dict[str, Any]
    cost: float = 1.0
    seeds: tuple[int, ...] = ()


Trial = Callable[[dict[str, Any], int], dict[str, Any]]
Cells = Mapping[str, CellResult]
Run = TypeVar("Run")


def grid(**settings: Sequence[Any]) -> list[Condition]:
    """Return a condition for each combination of the values of the settings; the last setting varies fastest.

    `settings`: the values of each setting, by its name.
    """
    return [Condition("-".join(map(str, values)), dict(zip(settings, values, strict=True))) for values in product(*settings.values())]


def no_options(parser: argparse.ArgumentParser) -> None:
    """Add no options: the default of `Sweep.add_options`."""


def no_requirement() -> None:
    """Require no optional package: the default of `Sweep.require`."""


@dataclass(frozen=True)
class Sweep:
    """The functions of an experiment that runs one trial under each condition with each seed (a `Method` of experiments.kit.experiment).

    Args:
        conditions: function that computes the conditions from the options of the run, among them the bool `quick`.
        trial: function that runs one cell, given the settings of its condition and a seed; returns JSON values and arrays by name, which
            depend on these two alone.  It must be a function of a module, so that other processes can import it.
        findings: function that computes the results from the finished cells, by cell name, sorted.
        plot: function that draws the finished cells and returns a Matplotlib Figure, as made by experiments.kit.plots.
        seeds: default of the option --seeds.
        add_options: function that adds the options of the experiment to a parser.
        require: function that is called before the first trial; raises MobeeError if an optional package that the trials need is absent.
        kept: glob patterns of the files in a run's folder that are kept in the repository as its raw record.
        summary: function that reduces the values of a cell to those from which `findings` and `plot` compute, for runs whose values are too
            large for the raw record; `findings` and `plot` get the reduced values.  None: the values are not reduced.
    """

    conditions: Callable[[argparse.Namespace], Iterable[Condition]]
    trial: Trial
    findings: Callable[[Cells], dict[str, Any]]
    plot: Callable[[Cells], Any]
    seeds: int = 10
    add_options: Callable[[argparse.ArgumentParser], None] = no_options
    require: Callable[[], object] = no_requirement
    kept: tuple[str, ...] = CELL_FILES
    summary: Callable[[dict[str, Any]], dict[str, Any]] | None = None

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the options that all sweeps have, and those of the experiment, to the parser."""
        sweep_arguments(parser, self.seeds)
        self.add_options(parser)

    def cells(self, arguments: argparse.Namespace) -> list[Cell]:
        """Return the cells of a run with these options: every condition with every seed."""
        seeds = range(arguments.seed, arguments.seed + arguments.seeds)
        return [
            Cell(f"{one.name}-s{seed}", seed, one.settings, one.cost) for one in self.conditions(arguments) for seed in one.seeds or seeds
        ]

    def run(self, arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
        """Run the cells that are not in the folder of the run yet, and return the results that `findings` computes from all cells."""
        self.require()
        run_cells(partial(_run_trial, self.trial), self.cells(arguments), folder, arguments)
        return self.results(folder)

    def results(self, folder: Path) -> dict[str, Any]:
        """Return the results that `findings` computes from the finished cells in the folder of a run.

        A cell is one trial with one condition and one seed.
        """
        return self.findings(self._loaded(folder))

    def _loaded(self, folder: Path) -> dict[str, CellResult]:
        found = load_cells(folder)
        return found if self.summary is None else {name: _summarised(one, self.summary) for name, one in found.items()}

    def recorded(self, folder: Path) -> AbstractContextManager[Path]:
        """Return a context manager that yields the folder of the cells for the raw record.

        Without `summary` it is the folder of the run.  With `summary` it is a temporary folder, in which the cells have only their reduced
        values.
        """
        return nullcontext(folder) if self.summary is None else reduced_cells(folder, partial(_reduced, self.summary))

    def figure(self, folder: Path) -> Path:
        """Draw the finished cells in the folder of a run, and return the path of the picture; raises InvalidValue if there are none."""
        found = self._loaded(folder)
        if not found:
            raise InvalidValue(f"{folder} has no finished cells: the run was stopped before the first.")
        return saved(self.plot(found), folder)


_SUMMARY = "is_summary"


def _summarised(one: CellResult, summary: Callable[[dict[str, Any]], dict[str, Any]]) -> CellResult:
    """Return a copy of the result of a cell (one trial), with `summary` applied to its values.

    `summary`: function that reduces the values to those that the results and the figure need.
    """
    found = CellResult(one.cell, one.seconds, one.path)
    vars(found)["values"] = _reduced(summary, one.values)  # where the property keeps what it has read
    return found


def _reduced(summary: Callable[[dict[str, Any]], dict[str, Any]], values: dict[str, Any]) -> dict[str, Any]:
    """Return the values that `summary` computes from the values of a cell (one trial), marked as reduced.

    Values with this mark, such as those that were read from a raw record, are returned unchanged.
    """
    return values if values.get(_SUMMARY) else summary(values) | {_SUMMARY: True}


def _run_trial(trial: Trial, cell: Cell) -> dict[str, Any]:
    return trial(cell.settings, cell.seed)


def grouped(found: Cells, setting: str, order: Sequence[Any]) -> dict[Any, list[dict[str, Any]]]:
    """Group the values of the finished cells (trials with one condition and seed) by the value of one setting.

    Returns for each value of the setting the list of its cells' values, sorted by seed.  `found`: the cells by name.  `setting`: name of
    the setting.  `order`: values of the setting, in the order of the returned groups; a value without finished cells is left out.
    """
    cells = sorted(found.values(), key=lambda result: result.cell.seed)
    groups = {value: [one.values for one in cells if one.cell.settings[setting] == value] for value in order}
    return {value: values for value, values in groups.items() if values}


def grouped_by(found: Cells, *settings: str) -> dict[tuple[Any, ...], list[dict[str, Any]]]:
    """Group the values of the finished cells (trials with one condition and seed) by the values of several settings.

    The key of a group is the tuple of the values of the settings, in the given order.  The group is the list of its cells' values, sorted
    by seed.  `found`: the cells by name.  `settings`: names of the settings.
    """
    return runs_by(found, lambda result: result.values, *settings)


def runs_by(found: Cells, of: Callable[[CellResult], Run], *settings: str) -> dict[tuple[Any, ...], list[Run]]:
    """Call `of` on each finished cell (trial with one condition and seed), and group the results by the values of several settings.

    The key of a group is the tuple of the values of the settings, in the given order.  The group is the list of the results of its cells,
    sorted by seed.  `found`: the cells by name.  `settings`: names of the settings.
    """
    groups: dict[tuple[Any, ...], list[Run]] = {}
    for result in sorted(found.values(), key=lambda result: result.cell.seed):
        groups.setdefault(tuple(result.cell.settings[setting] for setting in settings), []).append(of(result))
    return groups


def run_cells(work: Work, cells: Sequence[Cell], folder: Path, arguments: argparse.Namespace) -> None:
    """Run the cells that are not in `folder` yet; each is written to disk as soon as it is finished.

    `work`: function that runs one cell and returns its result, a dict of JSON values and arrays.  The result must depend only on the cell.
    The function must be importable from a module, because other processes run it.  `arguments`: the options `jobs`, `engine` and `track`.
    If the program is killed, only the unfinished cells are lost.  With the option --track, two things are also written as event files for
    TensorBoard: the learning curves of the agents of each cell, and the numbers in its result.

    Raises:
        InvalidValue: two cells have the same name, or the folder has a cell of this name with other settings.
        CellsFailed: cells failed; the message names the first ones, and the errors are in `folder`/cells/<name>.failed.txt.
    """
    _require_distinct(cells)
    left = _unfinished(cells, folder)
    if getattr(arguments, "track", None):
        work = partial(_tracked, work, folder / TRACK)
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
        listed = "\n".join(f"  {name}: {reason}" for name, reason in list(failed.items())[:MAX_LISTED])
        listed += f"\n  and {len(failed) - MAX_LISTED} more" if len(failed) > MAX_LISTED else ""
        raise CellsFailed(
            f"{len(failed)} of {len(cells)} cells failed, the others are finished (see {folder}/cells/*.failed.txt):\n{listed}"
        )


def _tracked(work: Work, folder: Path, cell: Cell) -> dict[str, Any]:
    with tracked(folder / cell.name):
        values = work(cell)
    track_values(values, folder / cell.name)
    return values


def _keep(done: Done, folder: Path) -> str:
    """Write a cell or its error to disk; returns the reason of its failure, "" if it succeeded."""
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
        raise InvalidValue(f"several cells are named {repeated[0]!r}: put the settings in which they differ into their names.")


def _unfinished(cells: Sequence[Cell], folder: Path) -> list[Cell]:
    """Return the cells that are not finished, the longest first, so that no core waits long for the last one."""
    done = load_cells(folder)
    for cell in cells:
        if cell.name in done and _identity(cell) != _identity(done[cell.name].cell):
            raise InvalidValue(f"{folder} holds the cell {cell.name} with other settings: begin a new run without --resume.")
    return sorted((cell for cell in cells if cell.name not in done), key=lambda cell: -cell.cost)


def _identity(cell: Cell) -> tuple[int, object]:
    return cell.seed, json.loads(json.dumps(cell.settings))  # as on disk, where tuples are lists


ENGINES = ("processes", "ray")


def sweep_arguments(parser: argparse.ArgumentParser, seeds: int = 10) -> None:
    """Add the options --seeds (default: `seeds`), --jobs, --engine and --quick to the parser."""
    parser.add_argument(
        "--seeds", type=positive_whole, default=seeds, metavar="N", help=f"repetitions with different seeds (default: {seeds})"
    )
    parser.add_argument("--jobs", type=positive_whole, metavar="N", help="cells at the same time (default: one per core)")
    text = "processes of this machine, or a Ray cluster (extra `cluster`; if none is running, one is started on this machine)"
    parser.add_argument("--engine", choices=ENGINES, default="processes", help=f"{text} (default: processes)")
    parser.add_argument("--quick", action="store_true", help="a short version, to check that the experiment works")


class TimeLeft:
    """Predicts the remaining time of a sweep from the costs of its cells and the time since the start.

    A cell is one trial with one condition and seed.  Its cost is its expected duration, relative to the others, in any unit.  `everything`:
    costs of all cells.  `left`: costs of the cells that are not finished at the time `start` [s].
    """

    def __init__(self, everything: Sequence[float], left: Sequence[float], start: float) -> None:
        self._all, self._left, self._start = sum(everything), sum(left), start
        self._done, self._now = 0.0, start

    def finished(self, cost: float, now: float) -> None:
        """Record that a cell (one trial) has ended at the time `now` [s]; `cost`: its expected duration relative to the others."""
        self._done, self._now = self._done + cost, now

    @property
    def fraction(self) -> float:
        """The share of the work that is done, 0 to 1: sum of the costs of the ended cells, divided by the sum of the costs of all cells.

        Cells that were finished before `start` count as ended.
        """
        return 1.0 - (self._left - self._done) / self._all if self._all else 1.0

    @property
    def seconds(self) -> float:
        """The predicted remaining time [s]; infinite until a first cell (one trial) has ended since `start`.

        It is the sum of the costs of the unfinished cells times the average time per unit of cost since `start`.
        """
        return (self._left - self._done) * (self._now - self._start) / self._done if self._done else float("inf")

    def __str__(self) -> str:
        left = round(self.seconds)
        if left < 60:
            return f"{left} s left"
        return f"{left // 60} min left" if left < 3600 else f"{left // 3600} h {left % 3600 // 60:02d} min left"
