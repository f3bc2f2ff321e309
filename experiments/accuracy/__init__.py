"""Accuracy: how true is what an agent has learnt of its actions?

Claim: curiosity learns the stochastic actions better than least-tried exploration, and counts without the imagined ones are about ten
times truer than the thesis' counts.  Source: aims of this reproduction; the thesis claims exploration that is "data-efficient" (7.2.1)
without measuring the model.  No numbers are published.  Run time: 4 minutes on 2 cores.

The error of a state-action is the L1 distance, 0 to 2, between the believed and the true distribution over outcomes.  Three worlds
of 81 states: the left arm on equidistant and on the 16 nearest neighbours, whose truth is that of walks which try every action 80 or 40
times from starts that are reached as an agent reaches them; and a table, known exactly, in which a plane cuts off three states of the
equidistant lattice, so that 13 of 432 state-actions are stochastic (the arm has hardly any).
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from experiments.accuracy.figure import draw
from experiments.accuracy.findings import CLAIMS, EXPLORED_BY, findings
from experiments.accuracy.worlds import WALK_TRIES, WALKS, WORLDS, plant_of, space_of
from experiments.learning.trial import begin_nearby, explore
from experiments.learning.truth import walk
from experiments.sweep import Cell, load_cells, run_cells, sweep_arguments
from mobee import CuriousAgent

NAME = "accuracy"
CLAIM = "curiosity learns the stochastic actions best, and counts without the imagined ones are ten times truer"
SOURCE = "aims of this reproduction, to thesis 7.2.1"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

TRANSITIONS = 4000
LONGEST_WALK = 120_000  # actions


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """The walks that find the truth of the arm, and every explorer in every world with every seed; --quick: the half-space only."""
    worlds = ["half-space"] if arguments.quick else list(WORLDS)
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    walks = [
        Cell(f"truth-{world}-s{seed}", seed, {"world": world, "explorer": "walk", "tries": WALK_TRIES[world]}, cost=8.0)
        for world, seed in product(worlds, WALKS)
        if world in WALK_TRIES
    ]
    return walks + [
        Cell(f"{world}-{explorer}-s{seed}", seed, {"world": world, "explorer": explorer}, cost=0.3 if world == "half-space" else 1.0)
        for world, explorer, seed in product(worlds, EXPLORED_BY, seeds)
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Explore; the record (T, 3)."""
    world, explorer = cell.settings["world"], cell.settings["explorer"]
    space = space_of(world)
    if explorer == "walk":
        seen = walk(space, plant_of(world), cell.settings["tries"], LONGEST_WALK, cell.seed)
    else:
        plant = plant_of(world)(cell.seed)
        begin_nearby(space, plant, cell.seed)
        seen = explore(CuriousAgent(space, plant, explorer, cell.seed), TRANSITIONS)
    return {"seen": seen.astype(np.uint16)}


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Error against transitions."""
    return draw(load_cells(folder), folder / "accuracy.png")
