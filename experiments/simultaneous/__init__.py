"""Learning the transitions and the reaches at the same time, from nothing, against the transitions first.

Claim: there is no reason that the transition model and the reaches cannot be learned simultaneously; where an action fails, contact with
a workspace object tells a negative reward of the problem from an update of the model.
Source: thesis 9.4.1 (future work).  Published: no numbers.  Run time: five minutes on 2 cores.

The right arm under the published law and the 27 targets, as in `reach`; a learner of `reach-predictors` that takes little time (--learner).
Everybody has the same total of actions, reaches included and evaluations not.  "contact": both at once, failures attributed by contact.
"first-3000", "first-1000": so many curious transitions without targets, as the thesis did it, then reaches; the model is changed no more.
"model": both at once, and every transition is an update of the model, as if nothing were felt.  "target": both at once, and every
transition that does not end in its goal is the target's fault, so that the model hears of successes alone.
A score is the sum of the rewards of the 27 targets in one evaluation.  The error of a model is the mean L1 distance, 0 to 2, of its beliefs
without imagined outcomes to the outcomes of walks without targets.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import Cell, load_cells
from experiments.kit.reaching.arm import reach_plant, reach_space
from experiments.kit.reaching.learning import LEARNERS
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.learning.truth import walk
from experiments.simultaneous.figure import draw
from experiments.simultaneous.findings import CLAIMS, findings
from experiments.simultaneous.trial import WAYS, trial

NAME = "simultaneous"
CLAIM = "transitions and reaches can be learned at the same time, if contact tells whose fault a failure is"
SOURCE = "thesis 9.4.1"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

LOOKS = (500, 1000, 1500, 2000, 3000, 3500, 4000)  # actions after which everybody is evaluated
LEARNER = "kernel-ucb"  # costs less than the plant; "gp-ucb-alike" many times that
QUICK = (500, 1000, 2000)
REPETITIONS = 2  # of an evaluation
WALKS = (9001, 9002)  # seeds that no learner has
TRIES, LONGEST_WALK = 20, 20_000  # of each transition in a walk; actions


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the experiment."""
    sweep_arguments(parser)
    parser.add_argument(
        "--learner", choices=list(LEARNERS), default=LEARNER, metavar="NAME", help=f"one of {', '.join(LEARNERS)} (default: {LEARNER})"
    )


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """The walks that find the truth, and every way with every seed."""
    looks = QUICK if arguments.quick else LOOKS
    walks = [Cell(f"truth-s{seed}", seed, {"way": "walk"}, 2.0) for seed in WALKS]
    return walks + [
        Cell(f"{way}-s{seed}", seed, {"way": way, "learner": arguments.learner, "looks": list(looks)})
        for seed in range(arguments.seed, arguments.seed + arguments.seeds)
        for way in WAYS
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Walk, the record (T, 3); or learn, see `trial`."""
    settings = cell.settings
    if settings["way"] == "walk":
        return {"seen": walk(reach_space(), reach_plant, TRIES, LONGEST_WALK, cell.seed).astype(np.uint16)}
    return trial(settings["way"], settings["learner"], settings["looks"], REPETITIONS, cell.seed)


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Scores and errors of the models against actions."""
    return draw(load_cells(folder), folder / "simultaneous.png")
