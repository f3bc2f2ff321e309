"""Accuracy: how true is what an agent has learnt of its actions?

Claim: curiosity learns the stochastic actions better than least-tried exploration, and counts without the imagined ones are about ten
times truer than the thesis' counts.  Source: aims of this reproduction; the thesis claims exploration that is "data-efficient" (7.2.1)
without measuring the model.  No numbers are published.  Run time: 3 minutes on 2 cores.

The error of a state-action is the L1 distance, 0 to 2, between the believed and the true distribution over outcomes.  The left arm on
81 and on 256 states (20-80 %), equidistant neighbours, and a table, known exactly, in which a plane cuts off three of 81 states.  The
arm's truth is that of walks which try every action 80 or 40 times, from starts that are reached as an agent reaches them.  Stochastic
are actions whose most likely outcome has less than .9: none of 432 on the arm with 81 states, some 25 of 1536 with 256, 13 of 432 of
the table.  A truth of so few tries has an error of its own, some .1 for an even chance: a floor to what is measured, which makes
ratios on the stochastic actions of the arm too small.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from experiments.accuracy.figure import draw
from experiments.accuracy.findings import CLAIMS, findings
from experiments.accuracy.worlds import WALKS, WORLDS, plant_of, space_of
from experiments.kit.cells import Cell, load_cells
from experiments.kit.exploration import begin_nearby, explore
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.kit.truth import walk
from mobee import CuriousAgent

NAME = "accuracy"
CLAIM = "curiosity learns the stochastic actions best, and counts without the imagined ones are ten times truer"
SOURCE = "aims of this reproduction, to thesis 7.2.1"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

LONGEST_WALK = 40_000  # actions; rank 4 has states that no walk reaches


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """The walks that find the truth of the arm, and every explorer in its worlds with every seed; --quick: the half-space only."""
    worlds = {name: world for name, world in WORLDS.items() if not (arguments.quick and world.tries)}
    walks = [
        Cell(f"truth-{name}-s{seed}", seed, {"world": name, "explorer": "walk"}, cost=8.0)
        for name, world in worlds.items()
        for seed in WALKS
        if world.tries
    ]
    explorations = [
        Cell(
            f"{name}-{explorer}-s{seed}", seed, {"world": name, "explorer": explorer}, world.transitions / (4000 if world.tries else 12000)
        )
        for name, world in worlds.items()
        for explorer in world.explorers
        for seed in range(arguments.seed, arguments.seed + arguments.seeds)
    ]
    return walks + explorations


def work(cell: Cell) -> dict[str, Any]:
    """Explore; the record (T, 3)."""
    name, explorer = cell.settings["world"], cell.settings["explorer"]
    space, world = space_of(name), WORLDS[name]
    if explorer == "walk":
        seen = walk(space, plant_of(name), world.tries, LONGEST_WALK, cell.seed)
    else:
        plant = plant_of(name)(cell.seed)
        begin_nearby(space, plant, cell.seed)
        seen = explore(CuriousAgent(space, plant, explorer, cell.seed), world.transitions)
    return {"seen": seen.astype(np.uint16)}


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Error against transitions."""
    return draw(load_cells(folder), folder / "accuracy.png")
