"""Pre-grasp: the hand over a table on which something was put after the map was made, with maps of growing density.

Claim: infeasible edges are found "when the back of the hand bumps into the object", the map is adapted and the way planned anew,
which "works well in practice"; but in a dense map "finding a path around a novel obstacle takes a very long time, because any
obstacle invalidates many, many edges".  Source: thesis 4.3.3, 4.4, figs. 4.8, 4.9.  Published: 5000 vertices, k = 8; no numbers of
bumps.  Run time: 20 minutes on 2 cores.

The task of figure 4.8, palm down, 8 nearest neighbours, no edge checked, by least squares.  One part walks, so the map is of the right
arm's seven joints; it has poses in which no field and no limit pushes, 16 cm above the table (lower the hand feels the table), over
0.03 m2, with spacings from 20 to 2.4 mm: 75 to 5000 vertices.  Nothing is seen: of a query is known where it ends.  A cup, 10 cm high,
is put by the optimistic way to there; beside it there is a way on which it is nowhere 2 cm deep in a field.  Offline plant, default
law, motors as identified.  An edge has worked as soon as every joint is within 0.02 rad of its goal, the same for all maps; it failed,
a bump, if the arm comes to rest elsewhere; then the arm goes back the way it came until it is at a vertex, and the way is planned anew.
"remove": what failed is out, both ways; "reweigh": it is dear.  At most 600 edges a query.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from experiments.pregrasp.figure import draw
from experiments.pregrasp.findings import CLAIMS, findings
from experiments.pregrasp.settings import SPACINGS
from experiments.pregrasp.trial import queried
from experiments.sweep import Cell, load_cells, run_cells, sweep_arguments

NAME = "pregrasp"
CLAIM = "bumps adapt a map to things that were put on the table; the denser the map, the more of them it takes"
SOURCE = "thesis 4.3.3, 4.4"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

QUERIES = 3


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser, seeds=5)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Each density with each seed; the short version has two densities and one query."""
    spacings, queries = (SPACINGS[:2], 1) if arguments.quick else (SPACINGS, QUERIES)
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    made = [(spacing, seed) for spacing in spacings for seed in seeds]
    return [
        Cell(f"d{1e3 * spacing:.1f}-q{queries}-s{seed}", seed, {"spacing": spacing, "queries": queries}, (0.01 / spacing) ** 2)
        for spacing, seed in made
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Put cups on the table, and go past them."""
    return queried(cell.seed, cell.settings["spacing"], cell.settings["queries"])


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Bumps and time until success against the density of the map."""
    return draw(load_cells(folder), folder / "pregrasp.png")
