"""Sweeps: one trial under each of several conditions with each of several seeds, on all cores or machines."""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from experiments.kit.cells import Cell, CellResult, Work, cell_path, load_cells, write_cell
from experiments.kit.command_line import Progress, positive_whole
from experiments.kit.engines import Done, in_processes, on_ray
from mobee.errors import InvalidValue, MobeeError

Engine = Callable[[Work, Sequence[Cell], int | None], Iterator[Done]]
_ENGINES: dict[str, Engine] = {"processes": in_processes, "ray": on_ray}

LISTED = 3  # failed cells that are named; the folder has all


class CellsFailed(MobeeError):
    """Raised at the end of a sweep in which cells failed; the others are finished and on disk."""


class Condition(NamedTuple):
    """What the trials with one setting have in common.

    `name`: unique in its sweep and safe as a file's name.  `settings`: JSON values.  `cost`: how long a trial takes beside the
    others, in any unit.  `seeds`: its own, if they are not those of the run.
    """

    name: str
    settings: dict[str, Any]
    cost: float = 1.0
    seeds: tuple[int, ...] = ()


Trial = Callable[[dict[str, Any], int], dict[str, Any]]
Cells = Mapping[str, CellResult]


def grid(**settings: Sequence[Any]) -> list[Condition]:
    """Every combination of the settings; the last one varies fastest."""
    return [Condition("-".join(map(str, values)), dict(zip(settings, values, strict=True))) for values in product(*settings.values())]


def no_options(parser: argparse.ArgumentParser) -> None:
    """Add nothing to what all sweeps have."""


def no_requirement() -> None:
    """Need nothing that may be absent."""


@dataclass(frozen=True)
class Sweep:
    """A method: one trial under each condition with each seed.

    Args:
        conditions: of the options; `quick` is among them, a bool.
        trial: of a condition's settings and a seed; returns JSON values and arrays, which these two alone decide.  A function of a
            module, so that other processes find it.
        findings: of the finished cells, sorted by name.
        plot: their figure, a matplotlib Figure; see experiments.kit.plots.
        seeds: how many there are unless --seeds says otherwise.
        add_options: adds options of its own.
        require: called before the first trial; raises MobeeError if an optional package that the trials need is absent.
    """

    conditions: Callable[[argparse.Namespace], Iterable[Condition]]
    trial: Trial
    findings: Callable[[Cells], dict[str, Any]]
    plot: Callable[[Cells], Any]
    seeds: int = 10
    add_options: Callable[[argparse.ArgumentParser], None] = no_options
    require: Callable[[], object] = no_requirement

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Options of the sweep."""
        sweep_arguments(parser, self.seeds)
        self.add_options(parser)

    def cells(self, arguments: argparse.Namespace) -> list[Cell]:
        """Every condition with every seed."""
        seeds = range(arguments.seed, arguments.seed + arguments.seeds)
        return [
            Cell(f"{one.name}-s{seed}", seed, one.settings, one.cost) for one in self.conditions(arguments) for seed in one.seeds or seeds
        ]

    def run(self, arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
        """Run the trials that the folder does not hold yet."""
        self.require()
        run_cells(partial(_run_trial, self.trial), self.cells(arguments), folder, arguments)
        return self.findings(load_cells(folder))

    def figure(self, folder: Path) -> Path:
        """Draw the finished cells; raises InvalidValue if there are none."""
        found = load_cells(folder)
        if not found:
            raise InvalidValue(f"{folder} has no finished cells: it was stopped before the first.")
        path = folder / "figure.png"
        self.plot(found).savefig(path, dpi=150)
        return path


def _run_trial(trial: Trial, cell: Cell) -> dict[str, Any]:
    return trial(cell.settings, cell.seed)


def grouped(found: Cells, setting: str, order: Sequence[Any]) -> dict[Any, list[dict[str, Any]]]:
    """The values of the finished cells, by seed, under each value of a setting that has some, in the given order."""
    cells = sorted(found.values(), key=lambda result: result.cell.seed)
    groups = {value: [one.values for one in cells if one.cell.settings[setting] == value] for value in order}
    return {value: values for value, values in groups.items() if values}


def grouped_by(found: Cells, *settings: str) -> dict[tuple[Any, ...], list[CellResult]]:
    """The finished cells, by seed, under each combination of values of several settings that has some."""
    groups: dict[tuple[Any, ...], list[CellResult]] = {}
    for result in sorted(found.values(), key=lambda result: result.cell.seed):
        groups.setdefault(tuple(result.cell.settings[setting] for setting in settings), []).append(result)
    return groups


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


ENGINES = ("processes", "ray")


def sweep_arguments(parser: argparse.ArgumentParser, seeds: int = 10) -> None:
    """Add --seeds, --jobs, --engine and --quick."""
    parser.add_argument(
        "--seeds", type=positive_whole, default=seeds, metavar="N", help=f"repetitions with different seeds (default: {seeds})"
    )
    parser.add_argument("--jobs", type=positive_whole, metavar="N", help="how many run at once (default: one a core)")
    text = "processes of this machine, or a Ray cluster (extra `cluster`; one of this machine's cores is started where none is)"
    parser.add_argument("--engine", choices=ENGINES, default="processes", help=f"{text} (default: processes)")
    parser.add_argument("--quick", action="store_true", help="a short version that shows whether it works")


class TimeLeft:
    """Counts costs of cells: `everything` there is, `left` at the moment `start` [s]."""

    def __init__(self, everything: Sequence[float], left: Sequence[float], start: float) -> None:
        self._all, self._left, self._start = sum(everything), sum(left), start
        self._done, self._now = 0.0, start

    def finished(self, cost: float, now: float) -> None:
        """One more cell is done, now [s]."""
        self._done, self._now = self._done + cost, now

    @property
    def fraction(self) -> float:
        """Of all costs, those of earlier runs too."""
        return 1.0 - (self._left - self._done) / self._all if self._all else 1.0

    @property
    def seconds(self) -> float:
        """At the pace so far."""
        return (self._left - self._done) * (self._now - self._start) / self._done if self._done else float("inf")

    def __str__(self) -> str:
        left = round(self.seconds)
        if left < 60:
            return f"{left} s left"
        return f"{left // 60} min left" if left < 3600 else f"{left // 3600} h {left % 3600 // 60:02d} min left"
