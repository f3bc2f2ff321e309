# SPDX-License-Identifier: Apache-2.0
"""Compare what three live agents learn at the table with what offline agents learn.

Claim: the three agents of the table experiment, each a process of its own in the live system in lockstep, learn transition models
that are statistically those of the same agents on the offline plant.  Source: aim of this reproduction (thesis 7.4 was done
live).  Published number: none.  Run time: 20 minutes on 2 cores, of which the live system takes two thirds.

The robot `icub` on its motor model (no physics), the published gains and graphs, whole-tree forces.  Test: the total variation
between the outcomes observed live and those of all offline seeds but one, mean over the state-actions that both tried at least twice; then
the rank of this number among the same numbers of the offline seeds, p.
With the same encoder noise both plants make the same run to the last bit (`mobee bench agree`); here they have
different seeds.  With --also the agents learn on physics too, which adds rows to the results and does not change the claim.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import CELL_FILES, Cell, load_cells
from experiments.kit.command_line import Progress, positive_whole
from experiments.kit.experiment import OUR_AIM, Experiment, Measured, Steps, claim, judged
from experiments.kit.learning.live import TASKS, Compared, compared, contact_rows, draw_distances, learn_live, learn_offline
from experiments.kit.live.launch import PHYSICS
from experiments.kit.plots import saved
from experiments.kit.sweep import run_cells, sweep_arguments
from mobee.store import STORE

TASK, ROBOT = "published", "kinematic"
TRANSITIONS, FEW = 2000, 20  # per part
MIN_TRIES = 2  # of a state-action that is compared
PIECE = 1000  # transitions per part between two launches
SEEDS = 19  # offline runs, as many as a rank test at the 5 % level needs
MARGIN = 0.01  # of total variation
LIVE_SEED = 900  # different from those of the offline runs


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of a sweep, --transitions and --also."""
    sweep_arguments(parser, seeds=SEEDS)
    parser.add_argument("--transitions", type=positive_whole, metavar="N", help=f"per part (default: {TRANSITIONS})")
    parser.add_argument("--also", nargs="+", choices=PHYSICS, default=[], metavar="PHYSICS", help=f"learn on {' and '.join(PHYSICS)} too")


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Return the offline seeds."""
    number = _transitions(arguments)
    seeds = range(arguments.seed, arguments.seed + max(2, arguments.seeds))
    return [Cell(f"{TASK}-n{number}-s{seed}", seed, {"task": TASK, "transitions": number}) for seed in seeds]


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Learn live and offline, and compare."""
    number = _transitions(arguments)
    with Progress() as progress:
        for robot in (ROBOT, *arguments.also):

            def report(made: int, robot: str = robot) -> None:
                progress.show(made / number, f"live, {robot}: {made} of {number}")

            learn_live(TASK, robot, LIVE_SEED, number, folder / TASK / robot, report, PIECE)
    run_cells(learn_offline, cells(arguments), folder, arguments)
    return results(folder)


def results(folder: Path) -> dict[str, Any]:
    """Compute the distances and the claim from the transitions in the folder."""
    number = next(int(result.cell.settings["transitions"]) for result in load_cells(folder).values())
    found = compared(folder, TASK, MIN_TRIES)
    one, offline = found.live[ROBOT], [seed.variation for seed in found.offline]
    physics = {
        name: {"total variation": round(other.variation, 4), "state-actions compared": other.compared}
        for name, other in found.live.items()
        if name != ROBOT
    }
    return ({"on physics": physics} if physics else {}) | {
        "transitions": {part: number for part in TASKS[TASK].parts},
        "total variation": {"live": round(one.variation, 4), "offline_low": round(min(offline), 4), "offline_high": round(max(offline), 4)},
        "share with the same most frequent outcome": {
            "live": round(one.agree, 4),
            "offline_mean": round(float(np.mean([seed.agree for seed in found.offline])), 4),
        },
        "state-actions compared": one.compared,
        "p": round(p_value(found), 4),
        "at the table": contact_rows(folder, TASK),
        "claims": judged((equal,), found),
    }


def p_value(found: Compared) -> float:
    """Return the probability that an offline run is as far from the others as the live run, by its rank among them."""
    farther = sum(seed.variation >= found.live[ROBOT].variation for seed in found.offline)
    return (1 + farther) / (1 + len(found.offline))


@claim(
    f"{OUR_AIM}; thesis 7.4",
    f"transition models learned live at the table, in lockstep, are those learned offline: total variation at most {MARGIN} above that of "
    "another offline run",
    "equivalent",
)
def equal(found: Compared) -> Measured:
    """Judge whether the models are equal: not met if the live run is too far away, else open, since one live run has no interval."""
    one, offline = found.live[ROBOT], [seed.variation for seed in found.offline]
    text = (
        f"total variation {one.variation:.4f} over {one.compared} state-actions, of offline runs {min(offline):.4f} to {max(offline):.4f}: "
        f"p = {p_value(found):.2f}"
    )
    is_far = one.variation > max(offline) + MARGIN
    return f"{text} (1 live run, too few for a verdict)", False if is_far and len(found.offline) >= SEEDS and one.compared else None


def figure(folder: Path) -> Path:
    """Draw the distances of the live run and every offline run from the others, and how often actions reach their goals."""
    return saved(draw_distances({TASK: compared(folder, TASK, MIN_TRIES)}, MIN_TRIES), folder, 130)


def _transitions(arguments: argparse.Namespace) -> int:
    return int(arguments.transitions or (FEW if arguments.quick else TRANSITIONS))


EXPERIMENT = Experiment(
    claim="three live agents at the table, in lockstep, learn what the same agents learn on the offline plant",
    source="aim of this reproduction; thesis 7.4",
    method=Steps(add_arguments, run, figure, results, (*CELL_FILES, f"{TASK}/{ROBOT}/{STORE}")),
    claims=(equal,),
)
