"""Uniformity: how evenly do three explorers visit states and try actions, and do failing actions stand out?

Claim: after 4000 transitions the curious agent's visits over states and tries over state-actions are more uniform than those of
random and least-tried exploration, but for spikes at the actions that run into constraints.
Source: paper 3.1, fig. 5 (one run of the real robot an explorer).  No numbers are published.  Run time: 2 minutes on 2 cores.

The left arm with its cable constraints and self-contacts; 81 states with actions to their 16 nearest neighbours (ties drawn once, with
one seed: all runs share that graph, and the numbers may be its own), and for comparison to their equidistant ones.  Actions at
constraints are those that fail in more than half of all explorers' tries together, those of the run that is judged left out.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.arm_learning import ARM_NEIGHBOURS, arm_plant, arm_space
from experiments.kit.cells import Cell, load_cells
from experiments.kit.exploration import begin_anywhere, explore
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.uniformity.figure import draw
from experiments.uniformity.findings import CLAIMS, EXPLORERS, GRAPHS, findings
from mobee import CuriousAgent

NAME = "uniformity"
CLAIM = "curious exploration is more uniform than random and least-tried, but for spikes at the actions that meet constraints"
SOURCE = "paper 3.1, fig. 5"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

TRANSITIONS, FEW = 4000, 1500


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Every graph and explorer with every seed."""
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    count = FEW if arguments.quick else TRANSITIONS
    return [
        Cell(f"{graph}-{explorer}-n{count}-s{seed}", seed, {"graph": graph, "explorer": explorer, "transitions": count})
        for graph, explorer, seed in product(GRAPHS, EXPLORERS, seeds)
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Explore; the record (T, 3)."""
    graph = ARM_NEIGHBOURS if cell.settings["graph"] == "nearest" else "equidistant"
    space, plant = arm_space(neighbours=graph), arm_plant(cell.seed)
    begin_anywhere(space, plant, cell.seed)
    agent = CuriousAgent(space, plant, cell.settings["explorer"], cell.seed)
    return {"seen": explore(agent, cell.settings["transitions"]).astype(np.uint16)}


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Visits and tries of one run an explorer, as published."""
    return draw(load_cells(folder), folder / "uniformity.png")
