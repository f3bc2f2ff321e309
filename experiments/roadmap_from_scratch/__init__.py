"""Roadmap from scratch: random poses, joined without a look at what is between them, and explored by the robot itself.

Claim: a map of 20 random samples, each joined to its 10 nearest neighbours without verifying an edge, is explored by commands
alone; infeasible edges are removed as they are met, until the feasible sub-graph is known.  Source: thesis 4.3.1, fig. 4.6.
Published: "approximately 90 minutes" at 10 % of maximum velocity; "small, randomly generated graphs often contain unreachable
vertices and edges".  Run time: a minute on 2 cores offline; `--live` about 15 minutes more.

Seven joints of the right arm of `icub` at its table under the default law, at 10 % speed; on the offline plant with the identified
motors, and with `--live` also by the real processes in lockstep with PyBullet.  A vertex is reached within 0.15 rad in every
joint; where an edge failed the arm goes back.  Targets are drawn in proportion to untried edges; where nothing is left to try that
can be come to, RRT-Connect is asked for a single way to what is left, up to three times a vertex.  Every edge that was tried is
then tried once more from rest at its vertex, by another plant: whether both agree.  Solid contacts of the simulator's list of
pairs: offline by the model, from the true joints every 0.1 s; live by PyBullet, every tick.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from experiments.kit.cells import Cell, load_cells
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.roadmap_from_scratch.figure import draw
from experiments.roadmap_from_scratch.findings import CLAIMS, findings
from experiments.roadmap_from_scratch.live import finish, read_live
from experiments.roadmap_from_scratch.trial import explored
from mobee.roadmap.ompl import require_ompl

NAME = "roadmap-from-scratch"
CLAIM = "a map that nobody verified is explored by the robot until its feasible part is known, without harm"
SOURCE = "thesis 4.3.1, fig. 4.6"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

QUICK, LIVE = 30, 8 * 3600.0  # edges; s of robot time


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)
    parser.add_argument("--live", action="store_true", help="also explore the first seed's map by the real processes, in lockstep")


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """A map a seed."""
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    most = QUICK if arguments.quick else None
    return [Cell(f"map-s{seed}" + ("-quick" if most else ""), seed, {"most": most}) for seed in seeds]


def work(cell: Cell) -> dict[str, Any]:
    """Explore a map."""
    return explored(cell.seed, cell.settings["most"])


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left; raises OmplMissing before anything is begun."""
    require_ompl()
    run_cells(work, cells(arguments), folder, arguments)
    if arguments.live:
        finish(folder / "live", arguments.seed, QUICK if arguments.quick else None)
    return findings(load_cells(folder), read_live(folder / "live"))


def figure(folder: Path) -> Path:
    """The map before and after, and how it was explored."""
    return draw(load_cells(folder), read_live(folder / "live"), folder / "roadmap-from-scratch.png")
