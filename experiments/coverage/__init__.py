"""Coverage: how soon has an agent tried everything that it can do?

Claim: the curious agent (AC) has tried all state-actions in about half the time of the agent that takes the action least tried
(LT), the random one (RAND) is far behind; early on AC and LT try only what is new.  Source: paper 3.1, fig. 4; thesis 7.2.1, fig. 7.5.
Published number: AC/LT about 1/2, on the lattice of 81 states and their 16 nearest neighbours.
Run time: 2 minutes on 2 cores.

The left arm, with its cable constraints and self-contacts and without both (free), on the published graph and on that of the
equidistant neighbours; ties among the 16 nearest are drawn anew for every seed, the same for all explorers.  Floor: the fewest
actions that try every action if all succeed (the open Chinese postman's walk).  A run ends unfinished after 20 000 transitions.
Beside the published explorers: the way to the nearest untried action, and curiosity that depletes along its own plan.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from experiments.coverage.figure import draw
from experiments.coverage.findings import CLAIMS, findings
from experiments.coverage.postman import postman_floor
from experiments.kit.arm_learning import ARM_NEIGHBOURS, Neighbours, arm_plant, arm_space
from experiments.kit.cells import Cell, load_cells
from experiments.kit.exploration import LeastTries, begin_anywhere, explore
from experiments.kit.sweep import run_cells, sweep_arguments
from mobee import CuriousAgent
from mobee.learning.explorers import EXPLORERS

NAME = "coverage"
CLAIM = "the curious agent tries every action in about half the time of the least-tried strategy"
SOURCE = "paper 3.1 and fig. 4, thesis 7.2.1 and fig. 7.5"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

EXPLORED_BY = tuple(name for name in ("curious", "least_tried", "random", "nearest_untried", "depleting") if name in EXPLORERS)
GRAPHS: dict[str, Neighbours] = {"nearest": ARM_NEIGHBOURS, "equidistant": "equidistant"}
WORLDS = ("constrained", "free")
MOST = 20_000  # transitions: half of the random walks against constraints take longer
COST = {"random": 30.0, "least_tried": 5.0}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Every explorer on every graph in both worlds; --quick: the equidistant graph only."""
    graphs = ["equidistant"] if arguments.quick else list(GRAPHS)
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    return [
        Cell(
            f"{graph}-{world}-{explorer}-s{seed}",
            seed,
            {"graph": graph, "world": world, "explorer": explorer},
            COST.get(explorer, 1.0) * (3.0 if graph == "nearest" else 1.0) * (2.0 if world == "constrained" else 1.0),
        )
        for graph, world, explorer, seed in product(graphs, WORLDS, EXPLORED_BY, seeds)
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Explore until everything was tried; `new_actions`, `new_states`: the transitions, counted from 1, that tried or saw something new."""
    settings = cell.settings
    space = arm_space(neighbours=GRAPHS[settings["graph"]], tie_seed=cell.seed)
    plant = arm_plant(cell.seed, free=settings["world"] == "free")
    begin_anywhere(space, plant, cell.seed)
    agent = CuriousAgent(space, plant, settings["explorer"], cell.seed)
    start = agent.state
    seen = explore(agent, MOST, LeastTries(1, space.state_actions))
    pairs = seen[:, 0] * space.goals.shape[1] + seen[:, 1]
    return {
        "state_actions": space.state_actions,
        "floor": postman_floor(space.goals),
        "new_actions": _firsts(pairs) + 1,
        "new_states": _firsts(np.concatenate([[start], seen[:, 2]])),
        "transitions": len(seen),
        "seen": seen,
        "failed": float((seen[:, 2] != space.goals[seen[:, 0], seen[:, 1]]).mean()),
    }


def _firsts(values: np.ndarray) -> np.ndarray:
    """Where each value occurs first, ascending."""
    return np.sort(np.unique(values, return_index=True)[1])


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Untried state-actions against transitions, as published."""
    return draw(load_cells(folder), folder / "coverage.png")
