# SPDX-License-Identifier: Apache-2.0
"""Compare the transition model learned on the offline plant with that learned on PyBullet's robot.

Claim: the transition model learned offline, with motor parameters that were identified on PyBullet and then frozen, is that of PyBullet's
robot.  Source: an aim of this reproduction; the paper (4.1) says that the robot's time limits learning.
Published: no number.  Run time: about fifteen minutes on 2 cores for the arms, and as long again with --table.

Curious agents of both arms of the robot `icub` learn at the same time, on lattices with three levels per joint and four neighbours per
state, under the control gains of 2014; with --table also agents of torso and arms at the table.  Live: all services run in lockstep, with
PyBullet; for comparison also with MuJoCo and with the motor model alone.  Offline: the same agents learn on the offline plant with five
other seeds.  The run of each offline seed is compared with the other four; a perfect copy of the plant would have such a distance too, by
chance.  Therefore a live robot is also compared with four offline seeds at a time.  It counts as equal if its distance is at most 0.01, or
at most the upper bound for one more offline seed (whose distance would be below this bound with a probability of 95 %).  If the bound is
more than 0.02 (the margin of equivalence) above the mean distance of the offline seeds, these differ too much for a verdict.  One live run
can show that the models differ, but not that they are equivalent: then the claim stays open.  Both engines simulate masses, contacts of
solids and hard stops; the offline plant simulates motors and repulsive fields.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import stdtrit

from experiments.kit.cells import CELL_FILES, Cell, load_cells
from experiments.kit.command_line import Progress, positive_whole
from experiments.kit.experiment import OUR_AIM, Experiment, Measured, Steps, claim, judged
from experiments.kit.learning.live import (
    ROBOTS,
    Compared,
    Distance,
    compared,
    contact_rows,
    draw_distances,
    keep_observed,
    learn_live,
    learn_offline,
)
from experiments.kit.plots import saved
from experiments.kit.rules import all_hold
from experiments.kit.run_folder import read, write
from experiments.kit.sweep import run_cells, sweep_arguments
from mobee.store import STORE

MARGIN = 0.02  # of equivalence: the test must be able to detect a larger difference
EQUAL_DISTANCE = 0.01  # distance below which models count as equal, independent of the spread
LIVE_SEED = 100  # added to the seed: the live agents are not those of an offline seed
LEAST_FILE = "least.json"
TRANSITIONS, MIN_TRIES = 800, 2  # per part; of a state-action that is compared


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of a sweep, and --transitions (number per part), --least (tries of a compared action), --table and --only-table."""
    sweep_arguments(parser, seeds=5)
    parser.add_argument("--transitions", type=positive_whole, default=TRANSITIONS, metavar="N", help=f"per part (default: {TRANSITIONS})")
    text = f"tries from which a state-action is compared (default: {MIN_TRIES})"
    parser.add_argument("--least", type=positive_whole, default=MIN_TRIES, metavar="N", help=text)
    tables = parser.add_mutually_exclusive_group()
    tables.add_argument("--table", action="store_true", help="also torso and arms at the table")
    tables.add_argument("--only-table", action="store_true", help="torso and arms at the table alone")


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Return the cells (single runs) that learn on the offline plant: one for each task ("arms", "table") and seed, at least two seeds."""
    number = _transitions(arguments)
    seeds = range(arguments.seed, arguments.seed + max(2, arguments.seeds))
    return [Cell(f"{task}-s{seed}", seed, {"task": task, "transitions": number}) for task in _tasks(arguments) for seed in seeds]


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Learn on the offline plant and on each simulated robot, and return the results of the comparison.

    Finished cells (single offline runs) and live transitions that the folder already has are not repeated.
    """
    run_cells(learn_offline, cells(arguments), folder, arguments)
    number = _transitions(arguments)
    with Progress() as progress:

        def report(made: int) -> None:
            progress.show(made / number, f"{task} on {robot}: {made} of {number}")

        for task, robot in product(_tasks(arguments), ROBOTS):
            learn_live(task, robot, arguments.seed + LIVE_SEED, number, folder / task / robot, report)
            keep_observed(folder / task / robot, task)
    write(folder / LEAST_FILE, {"least": arguments.least})
    return results(folder)


def results(folder: Path) -> dict[str, Any]:
    """Compute the results from the transitions in the folder as a dict with the keys "claims" and "distances".

    "claims" is a list with the judged claim, as a dict (`Claim.record`).  "distances" is a dict from "task, robot", or "task, offline
    seeds, smallest" (also median, largest), to a row: "total variation" and "share with the same most frequent outcome", which compare the
    learned transition models with those of the (other) offline runs, and the number of "state-actions compared".  With runs at the table
    there is "at the table", too: a dict from "robot, part" to the numbers of the part's actions there: all, those that missed their goals,
    those that ended in contact with the table, and those that did both.
    """
    tasks = _compared(folder)
    table = {f"{task}, {robot}": row for task, found in tasks.items() for robot, row in _rows(found).items()}
    return {"claims": judged((equal,), tasks), "distances": table} | _at_the_table(folder)


def figure(folder: Path) -> Path:
    """Draw the distances of the live robots and the offline runs from the (other) offline runs, and how often actions reach their goals.

    A distance compares learned transition models, as in `results`.  Returns the path of the picture in the folder.
    """
    return saved(draw_distances(_compared(folder), _least(folder)), folder, 130)


def _least(folder: Path) -> int:
    return int(read(folder / LEAST_FILE)["least"])


def _compared(folder: Path) -> dict[str, Compared]:
    names = sorted({str(result.cell.settings["task"]) for result in load_cells(folder).values()})
    return {task: compared(folder, task, _least(folder)) for task in names}


def _at_the_table(folder: Path) -> dict[str, Any]:
    """Return the entry "at the table" of `results`: how the actions of each part ended at the table, on each robot.

    Returns an empty dict if there are no runs at the table.
    """
    return {"at the table": contact_rows(folder, "table")} if (folder / "table").exists() else {}


def _rows(found: Compared) -> dict[str, dict[str, Any]]:
    """Return how far the learned transition model of each live robot, and of the offline runs, is from those of the (other) offline runs.

    The keys are the robots and "offline seeds, smallest" (also median, largest); the rows are as in `results` under "distances".
    """
    variation, agree = (np.array([getattr(one, name) for one in found.offline]) for name in ("variation", "agree"))
    number = int(np.median([one.compared for one in found.offline]))
    rows = {robot: _plain(one) for robot, one in found.live.items()}
    for name, pick in (("smallest", np.min), ("median", np.median), ("largest", np.max)):
        rows[f"offline seeds, {name}"] = _plain(Distance(float(pick(variation)), float(pick(agree)), number))
    return rows


def _plain(one: Distance) -> dict[str, Any]:
    return {
        "total variation": round(one.variation, 4),
        "share with the same most frequent outcome": round(one.agree, 4),
        "state-actions compared": one.compared,
    }


@claim(
    OUR_AIM,
    "the transition model learned offline with identified motors is that learned on PyBullet's robot: distance from offline runs",
    "as near as another offline seed",
)
def equal(tasks: Mapping[str, Compared]) -> Measured:
    texts, verdicts = [], []
    for task, found in tasks.items():
        one = found.live["pybullet"]
        apart, differ = [seed.variation for seed in found.offline], [1.0 - seed.agree for seed in found.offline]
        verdicts += [_as_near(one.variation, apart), _as_near(1.0 - one.agree, differ)]
        detectable = max(prediction_bound(values) - float(np.mean(values)) for values in (apart, differ))
        texts.append(
            f"{task}: total variation {one.variation:.3f} (another offline seed: up to {prediction_bound(apart):.3f}),"
            f" share with the same most frequent outcome {one.agree:.3f} (another: at least {1.0 - prediction_bound(differ):.3f}),"
            f" {one.compared} state-actions; differences from {detectable:.3f} on are detectable (margin {MARGIN})"
        )
    return f"{'; '.join(texts)} (1 live run, too few for a verdict)", False if all_hold(verdicts) is False else None


def _as_near(value: float, offline: Sequence[float]) -> bool | None:
    """Return whether a live robot is as near to the offline runs as one more offline seed would be.

    `value`: distance of the robot from the offline runs.  `offline`: distance of each offline run from the others.  The robot is not as
    near if its distance is above EQUAL_DISTANCE and above `prediction_bound`.  Returns None if a distance is not finite (nothing was
    compared), or if the distances of the offline runs differ too much for a positive verdict (MARGIN).
    """
    most = prediction_bound(offline)
    if not np.isfinite([value, most]).all():
        return None
    if value > max(most, EQUAL_DISTANCE):
        return False
    return True if most - float(np.mean(offline)) <= MARGIN else None


def prediction_bound(values: Sequence[float]) -> float:
    """Return the bound below which one more value lies with a probability of 95 %, if all are normally distributed.

    `values`: at least two earlier values.
    """
    n = len(values)
    return float(np.mean(values) + stdtrit(n - 1, 0.95) * np.std(values, ddof=1) * np.sqrt(1.0 + 1.0 / n))


def _tasks(arguments: argparse.Namespace) -> list[str]:
    return ["table"] if arguments.only_table else ["arms", "table"] if arguments.table else ["arms"]


def _transitions(arguments: argparse.Namespace) -> int:
    return min(20, arguments.transitions) if arguments.quick else int(arguments.transitions)


EXPERIMENT = Experiment(
    claim="the transition model learned on the offline plant, with identified motors, is that of PyBullet's robot",
    source="aim of this reproduction; paper 4.1",
    method=Steps(add_arguments, run, figure, results, (*CELL_FILES, LEAST_FILE, f"*/*/{Path(STORE).stem}.npz")),
    claims=(equal,),
)
