"""Learning to reach: which exploration makes the best reacher, on the 27 targets of the thesis?

Claim: after about 800 problem-tries intrinsically motivated exploration makes a more competent agent than random or greedy optimistic
exploration, and it improves steadily, though it is the weakest after 100; its runs agree on a few favourite pre-reach poses, those of
the others do not; the random explorer collects the most negative rewards and takes twice the time.
Source: thesis 8.4, figs. 8.2 to 8.8; 3 strategies x 5 runs x 6400 problem-tries, evaluated 5 times after 100, 200, ... 6400.
Published: 207, 109 and 113 hours for 5 runs each, random, greedy and intrinsic; otherwise figures only.
Run time: 15 minutes on 2 cores; with 5 seeds, as published, 4.

The four joints of the right arm under the published law, 81 states and 432 transitions of equidistant neighbours, their outcomes learned
before by 3000 curious transitions without a target, anew for every seed.  Predictors, strategies and negative rewards as published,
with the resolutions of docs/reaching.md; distances in units of 1 cm (--scale).  A score is the sum of the rewards of the 27 targets in one
evaluation.  The targets and what inverse kinematics can reach of them: experiments/kit/reaching/README.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from experiments.kit.cells import Cell, load_cells
from experiments.kit.options import positive_number
from experiments.kit.reaching.arm import MARKER, laws, learned_beliefs, reach_plant, reach_space
from experiments.kit.reaching.learning import learn
from experiments.kit.reaching.targets import grid, targets_at
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.reach.figure import draw
from experiments.reach.findings import CLAIMS, findings
from experiments.reach.runs import LOOKS, STRATEGIES
from mobee.learning.reaching.predictors.predictor import SCALE
from mobee.learning.reaching.reach_agent import ReachAgent

NAME = "reach"
CLAIM = "intrinsic motivation makes the best reacher of the three published strategies, and the only one that knows its favourite poses"
SOURCE = "thesis 8.4, figs. 8.2-8.8"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

REPETITIONS = 5
COST = {"random": 2.0}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser, seeds=20)
    parser.add_argument("--law", choices=list(laws()), default="published", help="the law that the arm moves by (default: published)")
    parser.add_argument(
        "--scale", type=positive_number, default=SCALE, metavar="M", help=f"the unit of distances in the equations (default: {SCALE} m)"
    )


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Every strategy with every seed; --quick: 400 problem-tries."""
    looks = LOOKS[:3] if arguments.quick else LOOKS
    return [
        Cell(
            f"{strategy}-s{seed}",
            seed,
            {"strategy": strategy, "law": arguments.law, "scale": arguments.scale, "looks": list(looks)},
            COST.get(strategy, 1.0),
        )
        for strategy in STRATEGIES
        for seed in range(arguments.seed, arguments.seed + arguments.seeds)
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Learn the transitions, then to reach; see `experiments.kit.reaching.learning.learn`."""
    settings, plant = cell.settings, reach_plant(cell.seed, cell.settings["law"])
    beliefs = learned_beliefs(plant, cell.seed)
    agent = ReachAgent(reach_space(), plant, beliefs, marker=MARKER, strategy=settings["strategy"], scale=settings["scale"], seed=cell.seed)
    problems = targets_at(grid(), laws()[settings["law"]].aim)
    return learn(agent, problems, settings["looks"], REPETITIONS, {"grid": problems})


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Scores, favourite reaches, problem-tries and negative rewards, as published."""
    return draw(load_cells(folder), folder / "reach.png")
