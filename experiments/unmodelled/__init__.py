"""Reaching when the model is wrong: a learner against a planner that plans anew on every change, with and without memory.

Claim: where part of the truth is hidden, learning from tries overtakes planning with a model (thesis 9.3: one could plan the motions
offline, but moving the target just a little may invalidate the plan).
Source: thesis 5.3, 9.3; our own aims: equal by 200 tries, 20 points of success above it by 800.  Published: no numbers.
Run time: ten minutes on 2 cores, for 10 seeds.

The right arm of today's robot under the default law, and 27 targets that it can touch where no limit pushes: 12 of the thesis', the
others drawn between them; those that the ball closes off are left out.  Hidden from every planner: the rows of the shoulder's cables,
1 cm of the targets' places and 3 degrees of every joint, and a ball of 10 cm in the workspace, which is felt only as blocked motion.
"planners": only the planners' model is off; "everyone": also MoBeE's own, so that the learner's reaches are drawn as wrongly as the
peer's plans, and only the outcome tells; "nothing": nothing is hidden, as an anchor.
The learner knows the transitions of its lattice from 3000 curious ones without target and ball; it and the peer make the same number of
tries, each of the target least tried, from where the arm is.  The peer has inverse kinematics and RRT-Connect (OMPL) with the compiled
validity test, 20 actions a try to the learner's 10, and remembers: nothing, where motions were blocked, or also which poses missed.
Who has used up the actions of a try has failed, whatever it was that used them up.
The seeds draw the ball, the errors, noise and starts.  Seed 0 was looked at while scene and peer were made: what is reported begins with
--seed 1.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from experiments.kit.cells import Cell, load_cells
from experiments.kit.reaching.planner_peer import MEMORIES
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.prm_vs_mdp.ompl_roadmap import require_ompl
from experiments.unmodelled.contestants import Contestant, Learner, Planner
from experiments.unmodelled.figure import draw
from experiments.unmodelled.findings import CLAIMS, claims, summary
from experiments.unmodelled.scene import WRONG, make_scene

NAME = "unmodelled"
CLAIM = "with part of the truth hidden, a reach learner overtakes a planner that plans anew on every change"
SOURCE = "thesis 5.3, 9.3; aim of this reproduction"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

TRIES = (5, 25, 50, 100, 200, 400, 800)  # after which they are evaluated
REPETITIONS = 2  # of all targets, an evaluation
COSTS = {"learner": 7.0, "none": 5.0, "blocked": 17.0, "missed": 23.0}  # s of processor time


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the experiment."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Of each seed: the learner and each peer, under each kind of error."""
    tries = TRIES[:4] if arguments.quick else TRIES
    return [
        Cell(f"{who}-{wrong}-s{seed}", seed, {"who": who, "wrong": wrong, "tries": list(tries)}, COSTS[who])
        for seed in range(arguments.seed, arguments.seed + arguments.seeds)
        for wrong in WRONG
        for who in (("learner", *MEMORIES) if wrong != "nothing" else ("none",))  # the learner has no planner's model
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Learn, and be evaluated after so many tries."""
    who, tries = cell.settings["who"], cell.settings["tries"]
    scene = make_scene(cell.seed, cell.settings["wrong"])
    contestant: Contestant = Learner(scene, cell.seed) if who == "learner" else Planner(scene, who, cell.seed)
    rows, made = [], 0
    for n in tries:
        if who != "none":  # which learns nothing
            contestant.learn(n - made)
            made = n
        rows.append(contestant.evaluate(REPETITIONS).values() | {"hours": contestant.hours})
    found: dict[str, Any] = {"rows": rows, "targets": len(scene.targets)}
    if isinstance(contestant, Planner):
        found |= {"planning": contestant.planning, "remembered": contestant.peer.remembered}
    return found


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Work off all cells; returns the claims and the table.  Raises OmplMissing before anything is begun."""
    require_ompl()
    run_cells(work, cells(arguments), folder, arguments)
    done = load_cells(folder)
    return {"claims": [claim.record() for claim in claims(done)], **summary(done)}


def figure(folder: Path) -> Path:
    """Success against tries, learner and peers, under each kind of error."""
    return draw(load_cells(folder), folder / "unmodelled.png")
