"""Table: do three agents that know nothing of each other become interested in the table, which only two of them together can touch?

Claim: over time the agents of torso and arms bend forward, put the arms low and touch the table ever more often, in a cyclic manner;
what they try most are the actions whose outcomes depend on another part, both arms the same ones; an outcome that depends on
others spreads over a handful of states.
Source: paper 3.2 and 4.4, figs. 8 to 10; thesis 6.4, 7.4, figs. 7.10 to 7.12; one run of 18 000 transitions a learner in "a little more
than two full days".  Run time: 9 minutes on 2 cores, more than as much again with --part.

Torso (27 states, 8 neighbours) and arms (81 states, 16 neighbours, one graph for both) at a table 50 cm thick.  Counts of tries
alone say little, for a graph of 16 neighbours has favourites of its own, and all runs share one: each explorer also runs with a
ghost of the table, which exerts no force.  An arm action touches if at its end a field of the arm is within 2 cm of the table, or
in the ghost.
--part: contact forces end at the root of a part, as in the original program, so that the torso never feels the table.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.arm_learning import table_agents, table_plant
from experiments.kit.cells import Cell, load_cells
from experiments.kit.exploration import explore_together
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.table.figure import draw
from experiments.table.findings import CLAIMS, findings
from experiments.table.runs import ARMS, EXPLORERS, TRANSITIONS, WORLDS
from experiments.table.touch import is_forward, near_table

NAME = "table"
CLAIM = "torso and arms, three agents unaware of each other, become interested in the table: they lean forward and touch it ever more often"
SOURCE = "paper 3.2 and 4.4, thesis 7.4"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

QUICK = 2_000  # transitions a learner


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser, seeds=6)
    parser.add_argument("--part", action="store_true", help="also with contact forces that end at the root of a part")


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Every explorer at the table and at its ghost with every seed."""
    transitions, name = (QUICK, "quick-") if arguments.quick else (TRANSITIONS, "")
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    ways = ("tree", "part") if arguments.part else ("tree",)
    return [
        Cell(
            f"{name}{way}-{explorer}-{world}-s{seed}",
            seed,
            {"explorer": explorer, "world": world, "propagate": way, "transitions": transitions},
            2.0 if world == "table" else 1.0,
        )
        for way, explorer, world, seed in product(ways, EXPLORERS, WORLDS, seeds)
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Explore; of each part its transitions and how long they took, of the arms whether they touched at the end and the torso was bent."""
    count = cell.settings["transitions"]
    plant = table_plant(cell.seed, cell.settings["world"] == "ghost", cell.settings["propagate"])
    logs = explore_together(table_agents(plant, cell.settings["explorer"], cell.seed), plant, count)
    values: dict[str, Any] = {}
    for part, log in logs.items():
        values |= log.arrays(part, count)
    for arm in ARMS:
        poses = np.array(logs[arm].poses[:count])
        values |= {f"touch_{arm}": near_table(poses, arm), f"forward_{arm}": is_forward(poses)}
    return values


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Tries of the three learners as published, and how much of them is interest in the table."""
    return draw(load_cells(folder), folder / "table.png")
