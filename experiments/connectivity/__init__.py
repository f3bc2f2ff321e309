"""Connectivity: how many actions should a state have?

Claim: the 16 neighbours a state of the published experiments were denser than necessary; fewer connections would shorten the time
it takes to learn.  Source: paper 4.1 (an impression, no numbers).  Run time: 4 minutes on 2 cores.

The left arm with its cable constraints and self-contacts; 81 states with actions to their 4 to 32 nearest neighbours (ties drawn anew
for every seed) or to the equidistant ones.  The curious agent learns; at fixed numbers of transitions its model is frozen, and
60 random pairs of states, the same for all graphs, become tasks: follow the plan until the part is in the goal state, for at
most 12 actions, on the same kind of robot with other noise.  A way is direct if no other could be shorter were every action to
succeed.  Learning time: transitions until every state-action was tried once.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from experiments.connectivity.figure import draw
from experiments.connectivity.findings import CLAIMS, GRAPHS, findings
from experiments.connectivity.tasks import Tasks, attempt, fewest_actions
from experiments.kit.arm_learning import arm_plant, arm_space
from experiments.kit.cells import Cell, load_cells
from experiments.kit.exploration import LeastTries, begin_anywhere, explore
from experiments.kit.sweep import run_cells, sweep_arguments
from mobee import CuriousAgent

NAME = "connectivity"
CLAIM = "16 neighbours a state are more than are needed: with fewer the robot learns sooner and plans as well"
SOURCE = "paper 4.1"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

BUDGETS = (250, 500, 1000, 2000, 4000)  # transitions
TASKS, MOST_ACTIONS = 60, 12


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Every graph with every seed; the short version stops learning early."""
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    budgets = list(BUDGETS[:3] if arguments.quick else BUDGETS)
    return [
        Cell(f"k{graph}-n{budgets[-1]}-s{seed}", seed, {"graph": graph, "budgets": budgets, "tasks": TASKS})
        for graph, seed in product(GRAPHS, seeds)
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Learn, and solve the tasks after each budget: success, and actions of those that succeeded, both (budgets, tasks)."""
    graph = cell.settings["graph"]
    space, plant = arm_space(neighbours=graph, tie_seed=cell.seed), arm_plant(cell.seed)
    begin_anywhere(space, plant, cell.seed)
    agent = CuriousAgent(space, plant, seed=cell.seed)
    once, covered = LeastTries(1, space.state_actions), None
    tasks = Tasks.drawn(space, cell.settings["tasks"], cell.seed)
    reached, actions = [], []
    for budget in cell.settings["budgets"]:
        if covered is None:
            explore(agent, budget - agent.transitions, once)
            covered = agent.transitions if agent.model.tries[space.goals >= 0].all() else None
        explore(agent, budget - agent.transitions)
        trial = arm_plant(cell.seed + 1000)
        found = [attempt(agent.model, trial, start, goal, MOST_ACTIONS) for start, goal in tasks.pairs]
        reached.append([one.reached for one in found])
        actions.append([one.actions for one in found])
    return {
        "reached": np.array(reached),
        "actions": np.array(actions, dtype=np.uint8),
        "fewest": np.array([fewest_actions(space, start, goal) for start, goal in tasks.pairs], dtype=np.uint8),
        "covered": covered,
        "state_actions": space.state_actions,
    }


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Success, length of the way and learning time against the number of neighbours."""
    return draw(load_cells(folder), folder / "connectivity.png")
