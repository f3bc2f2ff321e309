"""Pre-grasp: the hand over a table on which a cup was put after the map was made, with maps of growing density.

Claim: infeasible edges are found "when the back of the hand bumps into the object", the map is adapted and the way planned anew,
which "works well in practice"; but in a dense map "finding a path around a novel obstacle takes a very long time, because any
obstacle invalidates many, many edges".  Source: thesis 4.3.3, 4.4, figs. 4.8, 4.9.  Published: 5000 vertices, k = 8; no numbers of
bumps.  Run time: 5 minutes on 2 cores.

The map of figure 4.8 (torso and right arm, palm down 6 cm over the table, 8 nearest neighbours, no edge checked, by least squares) with
spacings from 4 cm to 8 mm: 170 to 4400 vertices.  Nothing is seen: of a query is known where it ends.  A cup, 10 cm high and 6 cm wide, is
put by the optimistic way to there, where another way is left.  The robot goes along the edges; a bump is the first edge on which
solids would touch, checked every millimetre; it is back where the edge began then, and the way is planned anew.  "edge": that edge is
taken out (thesis 4.2).  "around": ours, so are all that end within 3 cm of where it led, until nothing else is left.  What is found
after the bumps in the first query of each run is played by the offline plant under the default law.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from experiments.kit.cells import Cell, load_cells
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.pregrasp.figure import draw
from experiments.pregrasp.findings import CLAIMS, findings
from experiments.pregrasp.trial import queried

NAME = "pregrasp"
CLAIM = "bumps adapt a map to things that were put on the table; the denser the map, the more of them it takes"
SOURCE = "thesis 4.3.3, 4.4"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

SPACINGS = (0.04, 0.025, 0.016, 0.011, 0.008)  # m
QUERIES = 10


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the experiment."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Each density with each seed; the short version has two densities and two queries."""
    spacings, queries = (SPACINGS[:2], 2) if arguments.quick else (SPACINGS, QUERIES)
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    return [
        Cell(f"d{1e3 * spacing:g}-q{queries}-s{seed}", seed, {"spacing": spacing, "queries": queries}, (0.01 / spacing) ** 2 + 0.3)
        for spacing in spacings
        for seed in seeds
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Put cups on the table, and go past them."""
    return queried(cell.seed, cell.settings["spacing"], cell.settings["queries"])


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Work off all cells; returns the table and the claims."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Bumps and time until success against the density of the map."""
    return draw(load_cells(folder), folder / "pregrasp.png")
