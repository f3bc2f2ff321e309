"""Hypercube: does the curious agent work as expected where every action succeeds?

Claim: on the hypercube of 16 states and 64 actions all actions succeed, every action is tried at least 5 times after about the
fewest transitions possible, tries and values become uniform, and the values grow with the discount factor.
Source: thesis 7.1, figs. 7.2 and 7.3, table 7.1; the rewards of table 6.2.  Published number: 320 actions (64 x 5).
Run time: 10 seconds on 2 cores.

The left arm with its cable constraints and self-contacts, from a random state; discounts 0.5, 0.9 and 0.99, 50-50 initialisation.
Tries and values are looked at after 50 transitions and at the end.  Uniformity of early tries: their variance over that of a
uniformly random choice among 64 actions, 1 for a random choice and 0 for equal tries (spread_early, spread_end).  uneven_value:
standard deviation over mean of the values; value_of_limit: their mean over what earning the mean reward for ever is worth.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from experiments.hypercube.figure import draw
from experiments.hypercube.findings import CLAIMS, DISCOUNTS, EARLY, LEAST, findings
from experiments.kit.arm_learning import HYPERCUBE, arm_plant, arm_space
from experiments.kit.cells import Cell, load_cells
from experiments.kit.exploration import LeastTries, begin_anywhere, explore
from experiments.kit.sweep import run_cells, sweep_arguments
from mobee import CuriousAgent, value_iteration

NAME = "hypercube"
CLAIM = "on 16 states where every action succeeds, each is tried 5 times after about 320 actions, and tries and values become uniform"
SOURCE = "thesis 7.1"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

TOLERANCE = 1e-9  # nats
MOST = 5_000  # transitions, should an action be beyond reach


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Every discount with every seed; there is no shorter version."""
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    return [Cell(f"g{discount:g}-s{seed}", seed, {"discount": discount}) for discount, seed in product(DISCOUNTS, seeds)]


def work(cell: Cell) -> dict[str, Any]:
    """Explore until every action was tried 5 times; tries and values (16, 4) early and at the end."""
    space, plant = arm_space(HYPERCUBE), arm_plant(cell.seed)
    begin_anywhere(space, plant, cell.seed)
    agent = CuriousAgent(space, plant, seed=cell.seed, discount=cell.settings["discount"])
    enough = LeastTries(LEAST, space.state_actions)
    early = explore(agent, EARLY, enough)
    values: dict[str, Any] = {"early_tries": agent.model.tries.copy(), "early_values": _values(agent)}
    seen = np.concatenate([early, explore(agent, MOST, enough)])
    pairs = seen[:, 0] * space.goals.shape[1] + seen[:, 1]
    new = np.sort(np.unique(pairs, return_index=True)[1]) + 1
    return values | {
        "tries": agent.model.tries.copy(),
        "values": _values(agent),
        "rewards": agent.model.reward.copy(),
        "seen": seen,
        "transitions": len(seen),
        "all_once": int(new[-1]) if len(new) == space.state_actions else None,
        "failed": int((seen[:, 2] != space.goals[seen[:, 0], seen[:, 1]]).sum()),
    }


def _values(agent: CuriousAgent) -> np.ndarray:
    """Of the actions, solved farther than the agent needs them."""
    return value_iteration(agent.model, agent.model.reward, agent.discount, TOLERANCE)[1]


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Stacked tries and values of every state-action, early and at the end, as published."""
    return draw(load_cells(folder), folder / "hypercube.png")
