# SPDX-License-Identifier: Apache-2.0
"""Model throughput: evaluations per second while a thread edits the world without a pause (thesis Algorithm 1, FLOOD_MODEL).

Claim: every joint moves, and one thread removes and creates boxes as fast as it can, while the number of boxes in the world grows from 1 to
1000.  Meanwhile the model is evaluated, with consistent results, hundreds of times per second for the iCub among hundreds of boxes, and
more often for the Katana.  Source: thesis 2.4, figure 2.4.  Published: "hundreds of poses per second for a humanoid with hundreds of
obstacles" on a dual-core 2.4 GHz laptop; the figure's curves are not given as numbers.  Run time: three to five minutes for both robots,
with 1000 removals and 1000 creations at each number of boxes.

`--check` runs an endurance test instead: several threads add, move, remove, attach and detach objects of one world, and change their roles,
while the model is evaluated.  No evaluation may see an incomplete edit, no exception may be raised, and the memory must stay constant.
"""

from __future__ import annotations

import argparse
import itertools
import random
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, TypedDict, cast

import numpy as np

from experiments.claims.ch2_model.model_throughput_endurance import ENDURANCE, ENDURANCE_COLUMNS, endure, plot_endurance
from experiments.claims.ch2_model.model_throughput_threads import MovingModel, Oscillator, fast_thread_switching, random_boxes
from experiments.kit.command_line import Progress, positive_number, positive_whole
from experiments.kit.experiment import Experiment, Steps
from experiments.kit.plots import new_figure, saved
from experiments.kit.run_folder import Records, read_records
from mobee import Model, World, load_robot
from mobee.errors import InvalidValue

ROBOTS = ("katana", "icub")
RECORDS = "flood.csv"
ENDURANCE_SECONDS = 600.0  # s

STILL_SECONDS = 0.5  # s without edits
POOL = 4000  # boxes made in advance, so that no time is spent on random numbers
NUMBERS = (0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)  # of objects, at which rates are reported
NEAR = 0.1  # relative difference in the number of objects within which records are pooled: one takes some 20 ms
MIN_SECONDS = 0.2  # s; over shorter times the threads alternate too rarely for a rate

COLORS = {"katana": "tab:orange", "icub": "tab:blue"}
LABELS = {"katana": "Katana", "icub": "iCub"}
BIN = 1.0  # s of edits per point of a curve
HUNDREDS = (100.0, 1000.0)
STATE_RATE = 100.0  # Hz, at which the iCub's motors report (thesis 2.3.2)


class Record(TypedDict):
    """Counts of one measurement with a constant number of objects in the world.

    `robot`: "katana" or "icub".  `objects`: number of boxes in the world.  `edits`: number of boxes that were removed plus number of boxes
    that were added during the measurement; 0: nothing was edited.  `seconds`: duration.  `evaluations`: number of evaluations of the model.
    """

    robot: str
    objects: int
    edits: int
    seconds: float
    evaluations: int


COLUMNS = tuple(Record.__annotations__)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command-line options of this experiment to the parser."""
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=list(ROBOTS), metavar="ROBOT", help=f"of {', '.join(ROBOTS)}")
    parser.add_argument("--objects", type=positive_whole, default=1000, metavar="N", help="largest number of boxes (default: 1000)")
    parser.add_argument("--edits", type=positive_whole, default=1000, metavar="N", help="replaced boxes at each number (default: 1000)")
    parser.add_argument("--duration", type=positive_number, metavar="S", help="end after S seconds (default: never; --check: 600)")
    parser.add_argument("--check", action="store_true", help="endurance: many threads, every evaluation checked")
    parser.add_argument("--threads", type=positive_whole, default=4, metavar="N", help="editing threads, with --check (default: 4)")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Measure the throughput for each robot, and continue a run that was stopped in `folder`; with --check, run the endurance test instead.

    Returns a dict from the robot to the rates of evaluations and edits, as in `results`; with --check the counts and "passed" of the
    endurance test, as in `model_throughput_endurance.endure`.
    """
    if arguments.check:
        return endure(folder, threads=arguments.threads, duration=arguments.duration or ENDURANCE_SECONDS, seed=arguments.seed)
    give_up = time.monotonic() + arguments.duration if arguments.duration else float("inf")
    path = folder / RECORDS
    done = read_flood(path)
    with Records(path, COLUMNS) as records, Progress() as progress:
        for robot in arguments.robots:
            flooded = [record["objects"] for record in done if record["robot"] == robot and record["edits"]]
            first, last = max(flooded, default=0) + 1, arguments.objects
            for record in flood_model(
                robot, first=first, last=last, edits=arguments.edits, seed=arguments.seed, is_over=lambda: time.monotonic() > give_up
            ):
                records.append(record)
                progress.show(record["objects"] / last, _line(record))
    return results(read_flood(path), arguments)


def _line(record: Record) -> str:
    rate = record["evaluations"] / record["seconds"]
    return f"{record['robot']}, {record['objects']} objects: {rate:.0f} evaluations/s, {record['edits'] / record['seconds']:.0f} edits/s"


class Flood:
    """Boxes in a world; random boxes are replaced as fast as possible.

    `names`: names of the present boxes.  `robot`: short name of the robot, within whose reach the boxes are.  `seed`: of the sizes and
    positions of the boxes, and of the choice which box is replaced.
    """

    def __init__(self, world: World, robot: str, seed: int) -> None:
        self._world = world
        self._boxes = itertools.cycle(random_boxes(np.random.default_rng(seed), robot, POOL))
        self._numbers = itertools.count()
        self._choose = random.Random(seed).randrange
        self.names: list[str] = []

    def create_object(self) -> None:
        """Add one box to the world."""
        self.names.append(self._new())

    def replace_objects(self, times: int) -> None:
        """Remove a random box and add a new one, `times` times."""
        for _ in range(times):
            place = self._choose(len(self.names))
            self._world.remove(self.names[place])
            self.names[place] = self._new()

    def _new(self) -> str:
        name, made = f"box {next(self._numbers)}", next(self._boxes)
        self._world.add(name, made.shape, position=made.position, rotation=made.rotation)
        return name


def flood_model(robot: str, *, first: int, last: int, edits: int, seed: int, is_over: Callable[[], bool]) -> Iterator[Record]:
    """Evaluate the model of a moving robot while its world is edited, and yield a record for each number of objects from `first` to `last`.

    This is FLOOD_MODEL, thesis Algorithm 1: one thread evaluates the model without a pause, this thread replaces boxes.  `robot`: "katana"
    or "icub".  `edits`: number of boxes that are replaced at each number of objects.  `seed`: of the boxes and the motion.  If `first` is
    1, a record without boxes and edits comes first.  At the numbers 1, 2, 5, 10, 20, ... 1000 (NUMBERS) a second record, without edits, is
    added.  The run ends early when `is_over()` returns True.  An exception of the evaluating thread is raised here.
    """
    model = Model(load_robot(robot))
    flood = Flood(model.world, robot, seed)
    while len(flood.names) < first - 1:
        flood.create_object()
    oscillator = Oscillator(model.robot, np.random.default_rng(seed))
    with fast_thread_switching(), MovingModel(model, oscillator) as moving:
        timer = _Timer(robot, moving)
        time.sleep(STILL_SECONDS)  # loading and building at the start are not timed
        if first == 1:
            yield timer.record(0, 0, lambda: time.sleep(STILL_SECONDS))
        for objects in range(first, last + 1):
            if is_over():
                return
            flood.create_object()
            yield timer.record(objects, edits, lambda: flood.replace_objects(edits))
            if objects in NUMBERS:
                yield timer.record(objects, 0, lambda: time.sleep(STILL_SECONDS))


class _Timer:
    def __init__(self, robot: str, moving: MovingModel) -> None:
        self._robot, self._moving = robot, moving

    def record(self, objects: int, edits: int, work: Callable[[], None]) -> Record:
        begin, before = time.perf_counter(), self._moving.evaluations
        work()
        seconds, evaluations = time.perf_counter() - begin, self._moving.evaluations - before
        self._moving.check()
        return Record(robot=self._robot, objects=objects, edits=2 * edits, seconds=round(seconds, 6), evaluations=evaluations)


def read_flood(path: Path) -> list[Record]:
    """Read the records of a run from its file, a record for each measurement, in order; returns an empty list if there is no file."""
    types: dict[str, Any] = {"robot": str, "seconds": float}
    return [cast(Record, {name: types.get(name, int)(text) for name, text in row.items()}) for row in read_records(path, COLUMNS)]


def results(records: list[Record], arguments: argparse.Namespace) -> dict[str, Any]:
    """Return a dict from the robot to its measured rates, and under "complete" whether every robot was measured up to --objects objects.

    Keys of each robot: "evaluations_per_second_flooded" (with edits) and "evaluations_per_second_still" (without edits), each a dict from
    the number of objects to the rate; "edits_per_second"; "objects_reached", the largest number of objects; and "note", only if all edits
    together lasted less than MIN_SECONDS (0.2 s): a text that says that this time is too short to measure a rate.  `arguments`: the options
    of the run.
    """
    found: dict[str, Any] = {}
    for robot in arguments.robots:
        mine = [record for record in records if record["robot"] == robot]
        flooded, still = [r for r in mine if r["edits"]], [r for r in mine if not r["edits"]]
        seconds = sum(r["seconds"] for r in flooded)
        found[robot] = {
            "evaluations_per_second_flooded": dict(rates(flooded)),
            "evaluations_per_second_still": dict(rates(still)),
            "edits_per_second": round(sum(r["edits"] for r in flooded) / max(seconds, 1e-9)),
            "objects_reached": max((r["objects"] for r in flooded), default=0),
        }
        if seconds < MIN_SECONDS:
            found[robot]["note"] = f"edited for {seconds:.2g} s, too short for a rate: give more --edits or --objects"
    is_complete = all(found[robot]["objects_reached"] >= arguments.objects for robot in arguments.robots)
    return {"complete": is_complete, **found}


def rates(records: Iterable[Record]) -> Iterator[tuple[int, int]]:
    """Yield pairs (number of objects, evaluations per second), one for each of the numbers 0, 1, 2, 5, 10, ... 1000 (NUMBERS).

    A rate is computed from all records whose number of objects differs from the number in NUMBERS by at most 10 %.  If these records
    together cover less than MIN_SECONDS (0.2 s), the next nearest records are added.  If the mean number of objects of the records then
    differs by more than 10 %, this mean is yielded instead of the number.  A number is left out if no record has exactly this number of
    objects, or if all records together cover less than MIN_SECONDS.
    """
    known = list(records)
    for number in NUMBERS:
        if not any(r["objects"] == number for r in known):
            continue
        nearest = sorted(known, key=lambda r: abs(r["objects"] - number))
        count = sum(abs(r["objects"] - number) <= NEAR * number for r in nearest)
        while count < len(nearest) and _seconds(nearest[:count]) < MIN_SECONDS:
            count += 1
        pool = nearest[:count]
        if _seconds(pool) >= MIN_SECONDS:
            objects, rate = _point(pool)
            yield number if abs(objects - number) <= NEAR * number else round(objects), round(rate)


def binned(records: Iterable[Record], seconds: float) -> Iterator[tuple[float, float]]:
    """Yield the mean number of objects and the evaluations per second of groups of records.

    A group has consecutive records that last at least `seconds` together.  An incomplete last group is dropped, except if it is the only
    one.  Groups of less than MIN_SECONDS (0.2 s) are left out.
    """
    groups: list[list[Record]] = []
    for record in sorted(records, key=lambda r: r["objects"]):
        if not groups or _seconds(groups[-1]) >= seconds:
            groups.append([])
        groups[-1].append(record)
    if len(groups) > 1 and _seconds(groups[-1]) < seconds:
        groups.pop()
    for group in groups:
        if _seconds(group) >= MIN_SECONDS:
            yield _point(group)


def _seconds(records: Iterable[Record]) -> float:
    return sum(r["seconds"] for r in records)


def _point(group: Sequence[Record]) -> tuple[float, float]:
    """Return the mean number of objects, and evaluations per second."""
    return sum(r["objects"] for r in group) / len(group), sum(r["evaluations"] for r in group) / _seconds(group)


def figure(folder: Path) -> Path:
    """Draw the records of the run in `folder`, or of its endurance test if there was one, to a file, and return its path.

    Raises InvalidValue without records.
    """
    endured, records = read_records(folder / ENDURANCE, ENDURANCE_COLUMNS), read_flood(folder / RECORDS)
    if not endured and not records:
        raise InvalidValue(f"{folder} has no records: the run was stopped before the first.")
    return saved((plot_endurance(endured) if endured else plot(records)), folder)


def plot(records: Sequence[Record]) -> Any:
    """Return a figure of evaluations per second over the number of objects, as in thesis figure 2.4."""
    drawing = new_figure(8.0, 5.0)
    axes = drawing.add_subplot()
    most = max(max(record["objects"] for record in records), 1)
    if most > HUNDREDS[0]:
        claim = 'thesis: iCub, "hundreds of poses per second\n… with hundreds of obstacles"'
        axes.fill_between((HUNDREDS[0], min(most, HUNDREDS[1])), *HUNDREDS, color="0.85", zorder=0, label=claim)
    axes.axhline(STATE_RATE, color="0.5", linestyle=":", label="thesis: the iCub reports its state at 100 Hz")
    for robot, color in COLORS.items():
        mine = [record for record in records if record["robot"] == robot]
        if not mine:
            continue
        flooded = list(binned([record for record in mine if record["edits"]], BIN))
        still = list(binned([record for record in mine if not record["edits"]], 0.0))
        label = "with edits" if flooded else "with edits: too short for a rate"
        axes.plot(*_columns(flooded), "-s" if len(flooded) == 1 else "-", color=color, label=f"{LABELS[robot]}, {label}")
        axes.plot(*_columns(still), "--o", color=color, markersize=3.0, linewidth=0.8, label=f"{LABELS[robot]}, no edits")
    axes.set(xlabel="objects in the workspace", ylabel="evaluations per second", yscale="log", xlim=(0.0, 1.03 * most))
    axes.set_title("Thesis figure 2.4: model evaluations while the world is flooded with edits")
    axes.grid(which="both", alpha=0.2)
    axes.legend(fontsize=8)
    return drawing


def _columns(points: Sequence[tuple[float, float]]) -> tuple[list[float], list[float]]:
    return [x for x, _ in points], [y for _, y in points]


EXPERIMENT = Experiment(
    claim="the model evaluates hundreds of poses per second while its world is edited without a pause",
    source="thesis 2.4, Algorithm 1 and figure 2.4",
    method=Steps(add_arguments, run, figure),
)
