"""Kail: what is gained by counting outcomes in bins of variable number instead of over all states?

Claim: with plain KL divergence from a uniform prior every first try is equally interesting, so that it takes many tries to tell
failing actions from sound ones, and small state spaces are numerically more interesting than large ones; 'Kail' divergence has
neither problem.  Source: thesis 6.4.2 and 6.4.3, eqs. 6.6 to 6.9, tables 6.1 to 6.4.  Run time: half a minute on 2 cores.

On paper: the rewards of a sound, a failing and an uncertain action, try by try.  On the robot: the left arm, 81 states with 16
neighbours and its constraints, for 4000 transitions, and the torso, 27 states with 8 neighbours, for 900; both
divergences, all runs on one graph.  Failing actions are those that fail in more than half of the tries of all runs but the judged one.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kail.figure import draw
from experiments.kail.findings import CLAIMS, DIVERGENCES, PARTS, findings
from experiments.kail.spaces import plant_of, space_of
from experiments.kit.cells import Cell, load_cells
from experiments.kit.exploration import begin_anywhere, explore
from experiments.kit.sweep import run_cells, sweep_arguments
from mobee import CuriousAgent, TransitionModel

NAME = "kail"
CLAIM = "'Kail' divergence tells failing from sound actions in fewer tries than plain KL, whatever the size of the state space"
SOURCE = "thesis 6.4.2, 6.4.3"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

TRANSITIONS = {"left_arm": 4000, "torso": 900}
FEW = {"left_arm": 1000, "torso": 300}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Every part and divergence with every seed."""
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    counts = FEW if arguments.quick else TRANSITIONS
    return [
        Cell(f"{part}-{divergence}-n{counts[part]}-s{seed}", seed, {"part": part, "divergence": divergence, "transitions": counts[part]})
        for part, divergence, seed in product(PARTS, DIVERGENCES, seeds)
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Explore; the record (T, 3) and what each transition paid (T,)."""
    space, plant = space_of(cell.settings["part"]), plant_of(cell.settings["part"], cell.seed)
    begin_anywhere(space, plant, cell.seed)
    agent = CuriousAgent(space, plant, seed=cell.seed, divergence=cell.settings["divergence"])
    paid: list[float] = []
    seen = explore(agent, cell.settings["transitions"], lambda agent: _note(agent, paid))
    _note(agent, paid)
    return {"seen": seen.astype(np.uint16), "paid": np.array(paid, dtype=np.float32), "first_reward": first_reward(cell)}


def first_reward(cell: Cell) -> float:
    """What every action promises before anything was tried."""
    return float(TransitionModel(space_of(cell.settings["part"]), divergence=cell.settings["divergence"]).reward.max())


def _note(agent: CuriousAgent, paid: list[float]) -> bool:
    if agent.last is not None and agent.last.n > len(paid):
        paid.append(agent.last.reward)
    return False


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Rewards on paper, rewards of both parts over time, and tries of failing actions."""
    return draw(load_cells(folder), folder / "kail.png")
