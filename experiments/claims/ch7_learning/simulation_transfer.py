"""Transfer: is what is learned on the offline plant true of a robot with physics?

Claim: the transition model learned offline, with motor parameters that were identified on PyBullet and then frozen, is that of
PyBullet's robot.  Source: an aim of this reproduction; the paper (4.1) names the robot's time as what limits learning.
Published: no number.  Run time: about ten minutes on 2 cores for the arms; the table as much again.

Rank 3, four neighbours, the robot `icub` under the gains of 2014, curious agents of both arms at once; with --table those of torso and
arms at the table.  Live: all services in lockstep, with PyBullet, and with the motor model alone as control.  Offline: the same
agents with five other seeds.  How far each of them is from the four others is the noise that even a perfect twin would show, so a
live robot is held against four of them at a time too.  It passes within what one more seed would do with 95 %, or within 0.01.
That is the claim's verdict only where that bound is less than 0.02 above the offline mean, the margin of equivalence; else the
offline seeds differ too much for a verdict, and it is open.
PyBullet has masses, contacts of solids and hard stops; the offline plant has motors and fields.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import stdtrit

from experiments.kit.cells import Cell, load_cells
from experiments.kit.command_line import Progress, positive_whole
from experiments.kit.experiment import Claim, Experiment, Steps
from experiments.kit.learning.live import ROBOTS, learn_live, learn_offline
from experiments.kit.learning.outcome_distance import Compared, Distance, compared, draw_distances
from experiments.kit.run_folder import read, write
from experiments.kit.sweep import run_cells, sweep_arguments

ALIKE = Claim(
    "aim of this reproduction",
    "the transition model learned offline with identified motors is that of PyBullet's robot in lockstep",
    "as near as another offline seed",
)
MARGIN = 0.02  # of equivalence: a larger difference would have to be found
NEAR = 0.01  # what is nearer than that is the same, whatever the spread
LIVE_SEED = 100  # added to the seed: the live agents are not those of an offline seed
LEAST_FILE = "least.json"
TRANSITIONS, LEAST = 800, 2  # a part; tries of a state-action that is compared


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the experiment."""
    sweep_arguments(parser, seeds=5)
    parser.add_argument(
        "--transitions", type=positive_whole, default=TRANSITIONS, metavar="N", help=f"of each part (default: {TRANSITIONS})"
    )
    parser.add_argument("--least", type=positive_whole, default=LEAST, metavar="N", help=f"tries, to be compared (default: {LEAST})")
    parser.add_argument("--table", action="store_true", help="torso and arms at the table too")


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """The offline seeds of each task."""
    number = _transitions(arguments)
    seeds = range(arguments.seed, arguments.seed + max(2, arguments.seeds))
    return [Cell(f"{task}-s{seed}", seed, {"task": task, "transitions": number}) for task in _tasks(arguments) for seed in seeds]


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Learn offline and live, and compare."""
    run_cells(learn_offline, cells(arguments), folder, arguments)
    number = _transitions(arguments)
    with Progress() as progress:

        def report(made: int) -> None:
            progress.show(made / number, f"{task} on {robot}: {made} of {number}")

        for task, robot in product(_tasks(arguments), ROBOTS):
            learn_live(task, robot, arguments.seed + LIVE_SEED, number, folder / task / robot, report)
    tasks = {task: compared(folder, task, arguments.least) for task in _tasks(arguments)}
    write(folder / LEAST_FILE, {"least": arguments.least})
    table = {f"{task}, {robot}": row for task, found in tasks.items() for robot, row in _rows(found).items()}
    return {"claims": [measured(tasks).record()], "distances": table}


def figure(folder: Path) -> Path:
    """Distances to the offline seeds together, and how often actions reach their goals."""
    least = int(read(folder / LEAST_FILE)["least"])
    names = sorted({str(result.cell.settings["task"]) for result in load_cells(folder).values()})
    path = folder / "figure.png"
    draw_distances({task: compared(folder, task, least) for task in names}, least).savefig(path, dpi=130)
    return path


def _rows(found: Compared) -> dict[str, dict[str, Any]]:
    """The distances of each live robot, and of the offline seeds."""
    variation, agree = (np.array([getattr(one, name) for one in found.offline]) for name in ("variation", "agree"))
    number = int(np.median([one.compared for one in found.offline]))
    rows = {robot: _plain(one) for robot, one in found.live.items()}
    for name, pick in (("least", np.min), ("median", np.median), ("most", np.max)):
        rows[f"offline seeds, {name}"] = _plain(Distance(float(pick(variation)), float(pick(agree)), number))
    return rows


def _plain(one: Distance) -> dict[str, Any]:
    return {"variation": round(one.variation, 4), "agree": round(one.agree, 4), "compared": one.compared}


def measured(tasks: Mapping[str, Compared]) -> Claim:
    """The claim with our numbers, of all tasks."""
    texts, verdicts = [], []
    for task, found in tasks.items():
        one = found.live["pybullet"]
        apart, differ = [seed.variation for seed in found.offline], [1.0 - seed.agree for seed in found.offline]
        verdicts += [_as_near(one.variation, apart), _as_near(1.0 - one.agree, differ)]
        detectable = max(prediction_bound(values) - float(np.mean(values)) for values in (apart, differ))
        texts.append(
            f"{task}: total variation {one.variation:.3f} (another offline seed: up to {prediction_bound(apart):.3f}),"
            f" same most frequent outcome {one.agree:.3f} (from {1.0 - prediction_bound(differ):.3f}), {one.compared} state-actions;"
            f" a difference of {detectable:.3f} would have been found (margin {MARGIN})"
        )
    return ALIKE.measured("; ".join(texts), False if False in verdicts else None if None in verdicts else True)


def _as_near(value: float, offline: Sequence[float]) -> bool | None:
    """Whether a robot is as near as another offline seed; None where nothing was compared, or a seed could be anywhere."""
    most = prediction_bound(offline)
    if not np.isfinite([value, most]).all():
        return None
    if value > max(most, NEAR):
        return False
    return True if most - float(np.mean(offline)) <= MARGIN else None


def prediction_bound(values: Sequence[float]) -> float:
    """The value below which one more of the same kind is with 95 %, if they are normally distributed."""
    n = len(values)
    return float(np.mean(values) + stdtrit(n - 1, 0.95) * np.std(values, ddof=1) * np.sqrt(1.0 + 1.0 / n))


def _tasks(arguments: argparse.Namespace) -> list[str]:
    return ["arms", "table"] if arguments.table else ["arms"]


def _transitions(arguments: argparse.Namespace) -> int:
    return min(20, arguments.transitions) if arguments.quick else int(arguments.transitions)


EXPERIMENT = Experiment(
    name="simulation-transfer",
    claim="what is learned on the offline plant, with identified motors, is what PyBullet's robot does",
    source="aim of this reproduction; paper 4.1",
    notes=__doc__,
    method=Steps(add_arguments, run, figure),
    claims=(ALIKE,),
)
