"""Decay: how does what there is to learn get less, over state-actions and over time?

Claim: the curious agent's reward decays uniformly over the state-actions, since wherever there is a spike it goes and gets it.
Source: paper 3.1, fig. 6 (snapshots, no numbers).  Run time: 1 minute on 2 cores.

The left arm with its cable constraints and self-contacts; 81 states with 16 neighbours, one graph for all runs, 4000 transitions.
Looked at: mean, largest and relative spread of the rewards of all state-actions at fixed times, for the curious agent, least-tried
and random exploration.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from experiments.decay.figure import draw
from experiments.decay.findings import CLAIMS, EXPLORERS, TIMES, findings
from experiments.learning.published import ARM_NEIGHBOURS, arm_plant, arm_space
from experiments.learning.trial import begin_anywhere, explore
from experiments.sweep import Cell, load_cells, run_cells, sweep_arguments
from mobee import CuriousAgent

NAME = "decay"
CLAIM = "the curious agent's reward decays uniformly over the state-actions: wherever it is high the agent goes and gets it"
SOURCE = "paper 3.1, fig. 6"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Every explorer with every seed; the short version leaves the last snapshots out."""
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    times = list(TIMES[:3] if arguments.quick else TIMES)
    return [
        Cell(f"{explorer}-n{times[-1]}-s{seed}", seed, {"explorer": explorer, "times": times})
        for explorer, seed in product(EXPLORERS, seeds)
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Explore; the rewards (snapshots, state-actions) at the times."""
    space, plant = arm_space(neighbours=ARM_NEIGHBOURS), arm_plant(cell.seed)
    begin_anywhere(space, plant, cell.seed)
    agent = CuriousAgent(space, plant, cell.settings["explorer"], cell.seed)
    snapshots = []
    for time in cell.settings["times"]:
        explore(agent, time - agent.transitions)
        snapshots.append(agent.model.reward[space.goals >= 0])
    return {"rewards": np.array(snapshots, dtype=np.float32), "times": cell.settings["times"]}


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Snapshots of one curious run, as published, and the decay of all."""
    return draw(load_cells(folder), folder / "decay.png")
