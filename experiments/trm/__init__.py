"""Task-relevant roadmaps: the maps of thesis figures 3.1 to 3.11 and 4.8, each by evolution and by least squares.

Claim: the framework produces maps for all these tasks: poses that meet the task's constraints, spread over its task space, in one graph.
Source: thesis 3.3, 3.4 and 4.3.  Published: figures only, about 5000 poses for figure 4.8.  Run time: about 5 minutes a seed
on 2 cores.

A task file says what a map is made of (experiments/trm/NAME.py).  What of its box can be reached at all is found by other means: a
flood of half the spacing with many starts a point, and random starts at random points.  A map covers of that what is within a spacing of a
vertex.  Every pose is checked by python-fcl.  `python -m experiments.trm NAME` builds one map and draws it.
"""

from __future__ import annotations

import argparse
import importlib
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import Cell, load_cells
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.trm.building import METHODS, built
from experiments.trm.coverage import reachable
from experiments.trm.examples import EXAMPLES
from experiments.trm.figure import draw
from experiments.trm.findings import CLAIMS, REACH, findings

NAME = "trm"
CLAIM = "maps for all tasks of thesis figures 3.1 to 3.11 and 4.8: their poses valid, their task spaces covered"
SOURCE = "thesis 3.3, 3.4, 4.3"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

COSTS = {"nes": 15.0, "least_squares": 2.0}  # beside each other
QUICK = ("inspect", "push-over", "unscrew")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser, seeds=5)
    parser.add_argument("--tasks", nargs="+", choices=tuple(EXAMPLES), metavar="TASK", help=f"of {', '.join(EXAMPLES)}")


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """What can be reached in every task, and its maps by every method with every seed; --quick: three small ones."""
    tasks = arguments.tasks or (QUICK if arguments.quick else tuple(EXAMPLES))
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    reach = [Cell(f"{task}-{REACH}", arguments.seed, {"task": task, "method": REACH}, 20.0) for task in tasks]
    maps = [
        Cell(f"{task}-{method}-s{seed}", seed, {"task": task, "method": method}, COSTS[method])
        for task in tasks
        for method in METHODS
        for seed in seeds
    ]
    return [*reach, *maps]


def work(cell: Cell) -> dict[str, Any]:
    """One map with its numbers, or the task points that can be reached."""
    example, method = EXAMPLES[cell.settings["task"]](), cell.settings["method"]
    if method == REACH:
        spacing = np.broadcast_to(example.spacing, len(example.task.names)).astype(np.float64)
        return {"points": reachable(example.model, example.costs, example.task, spacing, example.motors, example.start, example.margin)}
    return built(example, method, cell.seed)


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    importlib.import_module("mobee.collision.fcl_engine")  # raises NotInstalled before anything is begun
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """The clouds of all maps."""
    return draw(load_cells(folder), folder / "trm.png")
