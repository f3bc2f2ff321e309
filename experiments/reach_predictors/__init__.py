"""Predictors of reach rewards: how near do they come to one who knows the truth, and after how many problem-tries?

Claim: a predictor that shares what it learns over poses and targets brings at least .80 of an oracle's score after 200 problem-tries, .90
after 400 and .97 after 1600, and .80 on targets never tried after 800; the published one brings much less.
Source: aims of this reproduction, to thesis 8.5 and 9.4.4 ("a more powerful function approximator").  Published: no numbers.
Run time: 20 minutes on 2 cores.

The arm, its targets and its evaluations are those of `reach`; all learners have the same seeds, problems and transition models.  The oracle
plans in the same way, but knows the mean reward of every reach and which transitions a target blocks, both measured by 5 tries of each
on the plant (truth.npz in the run's folder).  Fractions are of the oracle's mean score over all seeds, so that they can exceed 1 by chance.
Targets never tried: the middles of the grid's eight cells.  "spread", "local", "alike": how failed transitions are remembered.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import Cell, load_cells
from experiments.kit.options import positive_number
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.reach_predictors.figure import draw
from experiments.reach_predictors.findings import CLAIMS, findings
from experiments.reach_predictors.learners import LEARNERS, LOOKS, ORACLE, TRUTH
from experiments.reaching.looks import learn, of_evaluations
from experiments.reaching.oracle import oracle
from experiments.reaching.scene import MARKER, laws, learned_beliefs, reach_plant, reach_space
from experiments.reaching.targets import between, grid, targets_at
from experiments.reaching.truth import TRIES, Truth, measure, truth_of
from mobee.learning.reaching.predictors.predictor import SCALE
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.robot.robot import Array

NAME = "reach-predictors"
CLAIM = "predictors that share over poses and targets reach nearly as well as one who knows the truth, after a few hundred tries"
SOURCE = "aims of this reproduction, to thesis 8.5 and 9.4.4"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

REPETITIONS = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)
    parser.add_argument("--law", choices=list(laws()), default="published", help="the law that the arm moves by (default: published)")
    parser.add_argument(
        "--scale", type=positive_number, default=SCALE, metavar="M", help=f"the unit of distances in the equations (default: {SCALE} m)"
    )
    parser.add_argument("--only", nargs="+", choices=list(LEARNERS), metavar="LEARNER", help=f"some of: {', '.join(LEARNERS)}")


def places(quick: bool) -> dict[str, Array]:
    """The targets that are learned and those that are not, by name; --quick: nine and one."""
    return {"grid": grid()[::3] if quick else grid(), "between": between()[:1] if quick else between()}


def truths(arguments: argparse.Namespace) -> list[Cell]:
    """The truth of every target."""
    settings: dict[str, Any] = {"what": TRUTH, "law": arguments.law, "tries": 1 if arguments.quick else TRIES}
    named = {name: found.tolist() for name, found in places(arguments.quick).items()}
    return [
        Cell(f"truth-{name}-{number}", 0, settings | {"place": place})
        for name, found in named.items()
        for number, place in enumerate(found)
    ]


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """The oracle and every learner with every seed; --quick: 200 problem-tries."""
    settings: dict[str, Any] = {"law": arguments.law, "scale": arguments.scale, "quick": arguments.quick}
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    looks = [100, 200] if arguments.quick else list(LOOKS)
    learners = [
        Cell(f"{name}-s{seed}", seed, settings | {"what": name, "looks": looks}, LEARNERS[name].cost)
        for name in arguments.only or LEARNERS
        for seed in seeds
    ]
    return learners + [Cell(f"oracle-s{seed}", seed, settings | {"what": ORACLE}, 0.2) for seed in seeds]


def find_truth(cell: Cell) -> dict[str, Any]:
    """Measure what is true of a target."""
    settings = cell.settings
    return measure(np.array(settings["place"]), settings["law"], settings["tries"]).values()


def work(truth: Truth, cell: Cell) -> dict[str, Any]:
    """Learn, or know the truth; be evaluated on the targets tried and on those never tried."""
    settings, space = cell.settings, reach_space()
    plant, aim = reach_plant(cell.seed, settings["law"]), laws()[settings["law"]].aim
    beliefs = learned_beliefs(plant, cell.seed)
    sets = {name: targets_at(found, aim) for name, found in places(settings["quick"]).items()}
    if settings["what"] == ORACLE:
        knowing = oracle(truth, space, plant, beliefs, MARKER, settings["scale"], cell.seed)
        each = (of_evaluations(name, [knowing.evaluate(found, 2 * REPETITIONS)]) for name, found in sets.items())
        return {key: value for one in each for key, value in one.items()}
    learner = LEARNERS[settings["what"]]
    agent = ReachAgent(
        space,
        plant,
        beliefs,
        marker=MARKER,
        predictor=learner.predictor,
        strategy=learner.strategy,
        failures=learner.failures,
        scale=settings["scale"],
        seed=cell.seed,
    )
    return learn(agent, sets["grid"], settings["looks"], REPETITIONS, sets)


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweeps: the truth, then what is compared with it."""
    wanted = truths(arguments)
    run_cells(find_truth, wanted, folder, arguments)
    found = load_cells(folder)
    truth = truth_of({tuple(cell.settings["place"]): found[cell.name].values for cell in wanted})
    truth.save(folder / "truth.npz")
    run_cells(partial(work, truth), cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Fractions of the oracle against problem-tries."""
    return draw(load_cells(folder), folder / "reach-predictors.png")
