"""The learned MDP as a planner: what it looks like, and how it plans around a table that comes, or comes and goes.

Claim: most learned state-actions reliably take the arm where they aim, a few lead elsewhere, always or sometimes (fig. 7); no static
workspace is needed, which a PRM planner cannot do without; and a planner trained with dynamic obstacles plans around the regions
where they tend to be.
Source: paper 2, 3.1, 3.2.1, fig. 7; thesis 7.4.1.  Published: no numbers but the figure's seven state-actions that lead elsewhere.
Run time: two minutes on 2 cores.

The left arm of the published robot, 81 states with 16 neighbours, 4000 curious transitions: without the table, or with one that
is set up or down at random after every ten actions; or 2000 without it, then it enters.  Plans are made from debiased counts, anew
after each action, and learn nothing from the 60 queries; in the straight way between start and goal, and there only, is the raised table.
Beside them: the lattice as a roadmap that was verified without the table, planned once or repaired when a motion fails.
The seeds draw noise and queries; all runs share one graph.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.arm_learning import ARM_NEIGHBOURS, RANK3, arm_space
from experiments.kit.cells import Cell, load_cells
from experiments.kit.exploration import explore
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.planner.figure import draw
from experiments.planner.findings import CLAIMS, ENTERS, claims, fates, summary
from experiments.planner.table import UP, TablePlant
from experiments.planner.trial import TESTS, Trial, roadmaps
from mobee import CuriousAgent

NAME = "planner"
CLAIM = "the learned planner needs no static workspace, and trained with a moving obstacle it plans around where that tends to be"
SOURCE = "paper 3.1, 3.2.1, fig. 7; thesis 7.4.1"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

LEARNED, BEFORE = 4000, 2000  # transitions, in all and before the table enters
AFTER = (0, 250, 500, 1000, 2000, 4000)  # transitions with the table that has entered
QUERIES = 60


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the experiment."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Of each seed: learned without the table, with one that moves, and one that enters, with and without forgetting."""
    settings: dict[str, Any] = {"queries": 10, "share": 0.25} if arguments.quick else {"queries": QUERIES, "share": 1.0}
    found = []
    for seed in range(arguments.seed, arguments.seed + arguments.seeds):
        found += [Cell(f"{way}-s{seed}", seed, settings | {"way": way}) for way in ("still", "moving", "roadmap")]
        found += [Cell(f"enters-{f:g}-s{seed}", seed, settings | {"way": "enters", "forgetting": f}, 2.0) for f in ENTERS]
    return found


def work(cell: Cell) -> dict[str, Any]:
    """Learn, and follow plans; the means over the queries by name."""
    settings, space = cell.settings, arm_space(RANK3, ARM_NEIGHBOURS)
    plant = TablePlant(cell.seed, moves=settings["way"] == "moving")
    trial = Trial.of_seed(plant, space, settings["queries"], cell.seed)
    if settings["way"] == "roadmap":
        return {"tests": {mode: trial.in_all_worlds(rival) for mode, rival in roadmaps(plant, space).items()}}
    agent = CuriousAgent(space, plant, seed=cell.seed, forgetting=settings.get("forgetting", 1.0))
    return _entered(agent, plant, trial, settings["share"]) if settings["way"] == "enters" else _learned(agent, trial, settings["share"])


def _learned(agent: CuriousAgent, trial: Trial, share: float) -> dict[str, Any]:
    seen = explore(agent, round(LEARNED * share))
    beliefs = agent.model.debiased()
    return {
        "seen": seen,
        "tests": {"plans": {test: trial.of_model(beliefs, test) for test in TESTS}},
        "fates": fates(agent.model),
        "outcomes": np.array(beliefs.outcomes),
        "probabilities": np.array(beliefs.probabilities),
    }


def _entered(agent: CuriousAgent, plant: TablePlant, trial: Trial, share: float) -> dict[str, Any]:
    before, after = round(BEFORE * share), [round(n * share) for n in AFTER]
    rows = []
    for n in after:
        agent.run(before + n - agent.transitions)
        plant.set_top(UP)
        rows.append(trial.of_model(agent.model.debiased(), "up"))
    return {"after": after, "rows": rows}


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Work off all cells; returns the claims and the table."""
    run_cells(work, cells(arguments), folder, arguments)
    done = load_cells(folder)
    return {"claims": [claim.record() for claim in claims(done)], **summary(done)}


def figure(folder: Path) -> Path:
    """The learned model as in fig. 7, the plans with a moving table, and how they recover when it has entered."""
    return draw(load_cells(folder), folder / "planner.png")
