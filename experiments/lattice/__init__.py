"""Lattice: what does the curious agent find out about the shoulder's constraints, and how does the way it plans show in its tries?

Claim: on 81 states and 432 actions every state-action is tried 5 times after 2987 actions (50-50) or 2651 (60-40); the states 24, 51
and 78 are hard to get into because some actions that should lead there fail; the agent's tries of what can be done there dip, the
less the farther it looks ahead; who expects success (60-40) tries the failing actions most often.
Source: thesis 7.2.2 to 7.2.5, figs. 7.4, 7.6 and 7.7; 5 runs a setting.  Run time: 1 minute on 2 cores.

The left arm with its cable constraints and self-contacts, from a random state; discounts 0.5, 0.9 and 0.99, both initialisations, until
every state-action was tried 5 times.  A state-action fails when it does not end in its goal state.  Actions are named by source
and goal state: the numbers of state-actions in the thesis leave their order open.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.arm_learning import arm_plant, arm_space
from experiments.kit.cells import Cell, load_cells
from experiments.kit.exploration import LeastTries, begin_anywhere, explore
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.lattice.figure import draw
from experiments.lattice.findings import CLAIMS, DISCOUNTS, INITIAL, LEAST, findings
from mobee import CuriousAgent

NAME = "lattice"
CLAIM = (
    "81 states: three are hard to enter, since actions into them fail; who looks farther ahead minds less, who expects success goes there"
)
SOURCE = "thesis 7.2.2-7.2.5"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

MOST = 20_000  # transitions, should an action be beyond reach


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Every initialisation and discount with every seed; the short version tries everything once."""
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    least, name = (1, "quick-") if arguments.quick else (LEAST, "")
    return [
        Cell(f"{name}{initial}-g{discount:g}-s{seed}", seed, {"initial": initial, "discount": discount, "least": least})
        for initial, discount, seed in product(INITIAL, DISCOUNTS, seeds)
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Explore until everything was tried often enough; tries and values (81, 8), transitions (T, 3), rewards at the end."""
    space, plant = arm_space(), arm_plant(cell.seed)
    begin_anywhere(space, plant, cell.seed)
    agent = CuriousAgent(space, plant, seed=cell.seed, discount=cell.settings["discount"], initial=cell.settings["initial"])
    seen = explore(agent, MOST, LeastTries(cell.settings["least"], space.state_actions))
    return {
        "seen": seen.astype(np.uint16),
        "tries": agent.model.tries.astype(np.uint16),
        "values": agent.plan()[1].astype(np.float32),
    }


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Stacked tries and values of every state-action for each initialisation and discount, as published."""
    return draw(load_cells(folder), folder / "lattice.png")
