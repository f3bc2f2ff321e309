# SPDX-License-Identifier: Apache-2.0
"""Compare what three live agents learn at the table with what offline agents learn.

Claim: the three agents of the table experiment (`table_discovery`), each a process of the live system in lockstep, learn transition models
that do not differ statistically from those of the same agents on the offline plant, and they touch the table and lean towards it as often.
Source: aim of this reproduction (thesis 7.4 was done live).  Published number: none.  Run time: 10 minutes on 2 cores, and 13 for each live
run.

The robot is `icub` with the published gains and graphs; contact forces act on all motors up to the root of the robot.  The offline plant
simulates the robot in one process.  The live robot is simulated by a motor model, or with --robots by PyBullet or MuJoCo; the motor
parameters of the offline plant were identified on PyBullet.  The models are compared by the total variation between the outcomes of a live
run and those of all offline runs except one, which are taken together.  Each offline run is left out in turn, and the results are averaged.
The variation is a mean over the state-actions that both sides tried at least twice.  For comparison, the variation between each offline run
and all others is computed, too.  Touch is the share of the arms' actions that ended in contact with table or ball.  Lean is the mean number
of tries of the torso's actions that lean forward, divided by the mean number of tries of its other actions.  Both are measured in the
second half of a run.  With the same encoder noise the live and the offline plant make exactly the same run (`mobee bench agree`); here they
have different seeds.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from experiments.claims.ch7_learning.table_measures import ARMS, FORWARD_STATES
from experiments.kit.cells import CELL_FILES, Cell, CellResult, load_cells
from experiments.kit.command_line import positive_whole
from experiments.kit.experiment import MIN_SEEDS, OUR_AIM, Experiment, Measured, Steps, claim, judged
from experiments.kit.learning.live import (
    TASKS,
    Contacts,
    Counts,
    Distance,
    counts_of,
    distance,
    learn_live,
    learn_offline,
    mean,
    observed,
    space,
)
from experiments.kit.live.launch import PHYSICS
from experiments.kit.plots import finish, new_figure, saved
from experiments.kit.rules import all_hold, decides, equivalent, of_each, texts
from experiments.kit.statistics import difference_interval, mean_over
from experiments.kit.sweep import run_cells, sweep_arguments
from mobee import Lattice, load_robot
from mobee.errors import InvalidValue

TASK, MOTORS, OFFLINE = "published", "kinematic", "offline"
ROBOTS = (MOTORS, *PHYSICS)
TRANSITIONS, FEW = 2000, 20  # per part
MIN_TRIES = 2  # of a state-action that is compared
PIECE = 1000  # transitions per part between two launches
SEEDS, LIVE_SEEDS = 19, 5  # of offline runs, and of live runs on each robot
VARIATION, TOUCH, LEAN = 0.01, 0.03, 0.3  # margins of equivalence
LIVE_SEED = 900  # the first; different from those of the offline runs
LIVE_COST = 5.0  # of a live run, relative to an offline one


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --seeds, --jobs, --engine, --quick, --live-seeds (live runs), --robots (simulators of live runs) and --transitions (per part)."""
    sweep_arguments(parser, seeds=SEEDS)
    text = f"live runs on each robot, one after the other (default: {LIVE_SEEDS})"
    parser.add_argument("--live-seeds", type=positive_whole, default=LIVE_SEEDS, metavar="N", help=text)
    text = f"live on these robots, of {', '.join(ROBOTS)} (default: {MOTORS}, the motor model)"
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=[MOTORS], metavar="ROBOT", help=text)
    parser.add_argument("--transitions", type=positive_whole, metavar="N", help=f"per part (default: {TRANSITIONS})")


def offline_cells(arguments: argparse.Namespace) -> list[Cell]:
    """Return the cells (single runs) that learn on the offline plant: one for each seed, at least two."""
    number = _transitions(arguments)
    seeds = range(arguments.seed, arguments.seed + max(2, arguments.seeds))
    return [Cell(f"{TASK}-n{number}-s{seed}", seed, {"task": TASK, "transitions": number}) for seed in seeds]


def live_cells(arguments: argparse.Namespace) -> list[Cell]:
    """Return the cells (single runs) that learn on the live system: one for each robot and seed.

    The cells are ordered by seed, and then by robot.  With --quick there is one seed.
    """
    number, seeds = _transitions(arguments), range(LIVE_SEED, LIVE_SEED + (1 if arguments.quick else arguments.live_seeds))
    return [
        Cell(f"{robot}-n{number}-s{seed}", seed, {"task": TASK, "transitions": number, "robot": robot}, LIVE_COST)
        for seed in seeds
        for robot in arguments.robots
    ]


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Learn on the offline plant and on the live system, and return the results of the comparison.

    The live runs are made one after the other.  Runs whose results are already in the folder are not repeated.
    """
    run_cells(learn_offline, offline_cells(arguments), folder, arguments)
    one_by_one = copy(arguments)
    one_by_one.jobs = 1
    run_cells(learn_in_system, live_cells(arguments), folder, one_by_one)
    return results(folder)


def learn_in_system(cell: Cell) -> dict[str, Any]:
    """Let the agents learn on the live system, in one run.

    `cell`: the run; its settings are "task", "transitions" (of each agent) and "robot".

    Returns for each part the transitions, `seen_PART` (T, 3), and whether each ended in contact with an object, `touched_PART` (T,): the
    same arrays as `experiments.kit.learning.live.learn_offline`.
    """
    task, number = str(cell.settings["task"]), int(cell.settings["transitions"])
    with tempfile.TemporaryDirectory() as scratch:
        learn_live(task, cell.settings["robot"], cell.seed, number, Path(scratch), lambda made: None, PIECE)
        return observed(Path(scratch), task, number)


@dataclass(frozen=True)
class Run:
    """One run of the three agents, offline or live; `result`: the stored result, with their transitions."""

    result: CellResult

    @cached_property
    def counts(self) -> Counts:
        """How often each action ended in each state, (S, A, S), by part."""
        return {part: counts_of(self.result.values[f"seen_{part}"], lattice) for part, lattice in _spaces().items()}

    @property
    def touch(self) -> float:
        """The share of the arms' actions in the second half of the run that ended in contact with table or ball."""
        return float(np.mean([_late(self.result.values[f"touched_{arm}"]).mean() for arm in ARMS]))

    @property
    def lean(self) -> float:
        """How often the torso leans forward, in the second half of the run.

        This is the mean number of tries of its actions with a goal state that leans forward, divided by that of its other actions.
        """
        lattice = _spaces()["torso"]
        tries = counts_of(_late(self.result.values["seen_torso"]), lattice).sum(axis=-1)
        forward = (lattice.goals >= FORWARD_STATES.start) & (lattice.goals < FORWARD_STATES.stop)
        return float(tries[forward].mean() / tries[~forward].mean())

    def contacts(self, part: str) -> Contacts:
        """Count the actions of a part, by how they ended.

        The numbers are: all actions; those that missed their goals; those that ended in contact with an object; and those that did both.
        """
        return Contacts.of(_spaces()[part], self.result.values[f"seen_{part}"], self.result.values[f"touched_{part}"])


Runs = Mapping[str, list[Run]]
"""The runs on each robot, by its name, and those on the offline plant under "offline"; each list is sorted by seed."""


def runs_in(folder: Path) -> Runs:
    """Return all finished runs in a folder, by robot, with those on the offline plant under "offline".

    Raises InvalidValue if fewer than two offline seeds are finished.
    """
    runs: dict[str, list[Run]] = {}
    for result in sorted(load_cells(folder).values(), key=lambda one: one.cell.seed):
        runs.setdefault(result.cell.settings.get("robot", OFFLINE), []).append(Run(result))
    if len(runs.get(OFFLINE, ())) < 2:
        raise InvalidValue(f"{folder}: fewer than two offline seeds have finished: continue with --resume.")
    return {name: runs[name] for name in (OFFLINE, *ROBOTS) if name in runs}


def distances(runs: Runs) -> dict[str, list[Distance]]:
    """Return a dict from the robot (or "offline") to the distance of the outcomes in each of its runs from those in the offline runs.

    A distance has the mean total variation of the outcomes of an action, and the share of actions with the same most frequent outcome.  An
    offline run is compared with all other offline runs together.  A live run is compared with all offline runs except one.  Each offline
    run is left out in turn, and the distances are averaged.
    """
    offline = [run.counts for run in runs[OFFLINE]]
    together = {part: np.sum([counts[part] for counts in offline], axis=0) for part in offline[0]}
    without = [{part: together[part] - counts[part] for part in counts} for counts in offline]
    live = {
        robot: [mean([distance(run.counts, others, MIN_TRIES) for others in without]) for run in group]
        for robot, group in runs.items()
        if robot != OFFLINE
    }
    return {OFFLINE: [distance(one, others, MIN_TRIES) for one, others in zip(offline, without, strict=True)]} | live


class Found(NamedTuple):
    """All finished runs, with their distances from the offline runs.

    `runs`: by robot, and under "offline".  `apart`: for each of these runs, in the same order, how far its outcomes are from those of the
    offline runs, as in `distances`.
    """

    runs: Runs
    apart: Mapping[str, list[Distance]]


NUMBERS: dict[str, Callable[[Run], float]] = {"touch": lambda run: run.touch, "lean": lambda run: run.lean}


def results(folder: Path) -> dict[str, Any]:
    """Compute the results from the finished cells (runs of one robot and seed) in the folder.

    Keys: "transitions", number of transitions of each agent in a run; "runs", a dict from the robot to a row with the number of runs, the
    distance of the learned transition models from those of the offline seeds, and measures at the table; "at the table", a dict from
    "robot, part" to a dict that counts the part's actions by how they ended there; "claims", a list with the judged claims, as dicts
    (`Claim.record`).  Raises InvalidValue if fewer than two offline seeds are finished.
    """
    runs = runs_in(folder)
    apart = distances(runs)
    return {
        "transitions": int(runs[OFFLINE][0].result.cell.settings["transitions"]),
        "runs": {name: _row(group, apart[name]) for name, group in runs.items()},
        "at the table": {f"{name}, {part}": _ends(group, part) for name, group in runs.items() for part in TASKS[TASK].parts},
        "claims": judged(CLAIMS, Found(runs, apart)),
    }


def _row(runs: Sequence[Run], apart: Sequence[Distance]) -> dict[str, float]:
    numbers = {name: mean_over(runs, number) for name, number in NUMBERS.items()}
    average = mean(apart)
    return {
        "runs": len(runs),
        "total variation": average.variation,
        "share with the same most frequent outcome": average.agree,
        "state-actions compared": average.compared,
    } | numbers


def _ends(runs: Sequence[Run], part: str) -> dict[str, int]:
    every = sum((run.contacts(part) for run in runs), Contacts(0, 0, 0, 0))
    return {
        "actions": every.actions,
        "missed their goals": every.missed,
        "ended in contact with table or ball": every.touching,
        "both": every.both,
    }


@claim(
    f"{OUR_AIM}; thesis 7.4",
    f"transition models learned live at the table, in lockstep, are those learned offline: total variation at most {VARIATION} above "
    "that of another offline run",
    "equivalent",
)
def equal(found: Found) -> Measured:
    variations = {name: [one.variation for one in group] for name, group in found.apart.items()}
    spans = {name: difference_interval(variations[name], variations[OFFLINE]) for name in _live(variations)}
    text = texts(variations, 4)
    return _of_enough(found.runs, text, [decides(span, most=VARIATION) for span in spans.values()])


@claim(
    f"{OUR_AIM}; thesis 7.4",
    f"live agents touch the table as often as offline ones: share of the arms' actions, second half, within {TOUCH}",
    "equivalent",
)
def touches(found: Found) -> Measured:
    return _equivalent(found.runs, NUMBERS["touch"], TOUCH, 3)


@claim(
    f"{OUR_AIM}; thesis 7.4",
    f"a live torso leans forward as often as an offline one: mean tries over those of its other actions, second half, within {LEAN}",
    "equivalent",
)
def leans(found: Found) -> Measured:
    return _equivalent(found.runs, NUMBERS["lean"], LEAN, 2)


CLAIMS = (equal, touches, leans)


def _equivalent(runs: Runs, number: Callable[[Run], float], margin: float, digits: int) -> Measured:
    found = of_each(runs, number)
    return _of_enough(runs, texts(found, digits), [equivalent(found[name], found[OFFLINE], margin) for name in _live(found)])


def _of_enough(runs: Runs, text: str, holds: Sequence[bool | None]) -> Measured:
    """Return the text and one verdict for all live robots: they must all hold.

    `holds`: the verdict of each robot.  If a robot has fewer than 5 live runs (MIN_SEEDS), the verdict is None (open), as the text states.
    """
    few = min((len(runs[name]) for name in _live(runs)), default=0)
    return (f"{text} ({few} live runs, too few for a verdict)", None) if few < MIN_SEEDS else (text, all_hold(holds))


def _live(groups: Mapping[str, Any]) -> list[str]:
    return [name for name in groups if name != OFFLINE]


def figure(folder: Path) -> Path:
    """Draw for each run the distance of its outcomes from the offline runs, and how often the agents touched the table and leant forward.

    The distance is the mean total variation (see `distances`); the other numbers are `Run.touch` and `Run.lean`.  Returns the path
    of the picture in the folder.
    """
    runs = runs_in(folder)
    panels = {"mean total variation a state-action": {name: [d.variation for d in group] for name, group in distances(runs).items()}}
    panels["share of the arms' actions that end at the table"] = of_each(runs, NUMBERS["touch"])
    panels["relative tries of leaning forward"] = of_each(runs, NUMBERS["lean"])
    drawing = new_figure(13.0, 4.2)
    for axes, (label, values) in zip(drawing.subplots(1, len(panels)), panels.items(), strict=True):
        for place, (name, group) in enumerate(values.items()):
            axes.plot(place + np.linspace(-0.15, 0.15, len(group)), group, "o", color="0.5" if name == OFFLINE else "tab:red", markersize=4)
        axes.set_xticks(range(len(values)), list(values), fontsize=8)
        finish(axes, xlim=(-0.5, len(values) - 0.5), ylabel=label)
        axes.set_ylim(0.0, 1.05 * max(max(group) for group in values.values()) or 1.0)
    return saved(drawing, folder, 130)


def _late(rows: Any) -> Any:
    return rows[len(rows) // 2 :]


@cache
def _spaces() -> dict[str, Lattice]:
    robot = load_robot("icub")
    return {part: space(robot, TASKS[TASK], part) for part in TASKS[TASK].parts}


def _transitions(arguments: argparse.Namespace) -> int:
    return int(arguments.transitions or (FEW if arguments.quick else TRANSITIONS))


EXPERIMENT = Experiment(
    claim="three live agents at the table, in lockstep, learn what the same agents learn on the offline plant",
    source="aim of this reproduction; thesis 7.4",
    method=Steps(add_arguments, run, figure, results, CELL_FILES),
    claims=CLAIMS,
)
