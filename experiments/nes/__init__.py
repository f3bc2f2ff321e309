"""Evolution strategies: natural ones beside CMA-ES.

Claim: NES is in many ways comparable to CMA, and outperforms CMA on some tasks.  Source: thesis 3.1.  Published: no numbers here.
Run time: 3 minutes on 2 cores.

A task is a function (sphere, ellipsoid and cigar of condition 1e6, Rosenbrock) of 10, 20 or 41 dimensions, rotated; each run has its own
rotation and its own start in [-1, 1], the same for all strategies, and standard deviation 0.5.  What counts are evaluations until f < 1e-8;
who never comes there counts with 400 000.  Strategies: xNES and SNES as published (Glasmachers 2010, Schaul 2011), the library's default
(xNES with CMA-ES's path, weights and rates), and CMA-ES by its author, all with their default populations.  "Outperforms on some tasks":
on one of the twelve at most .95 of CMA-ES's evaluations; "comparable": at most 1.5 times as many, median of the tasks.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from experiments.bench.cma_peer import load_cma
from experiments.bench.nes_workload import FUNCTIONS, MOST, STRATEGIES, trial
from experiments.kit.cells import Cell, load_cells
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.nes.figure import draw
from experiments.nes.findings import CLAIMS, DIMENSIONS, findings

NAME = "nes"
CLAIM = "natural evolution strategies are comparable to CMA-ES, and outperform it on some tasks"
SOURCE = "thesis 3.1"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

COSTS = {"nes": 1.0, "cma": 6.0, "xnes": 4.0, "snes": 8.0}  # beside each other


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Every strategy on every task with every seed; --quick: 10 dimensions and 20 000 evaluations."""
    most = 20_000 if arguments.quick else MOST
    return [
        Cell(
            f"{strategy}-{function.replace(' ', '-')}-{d}-s{seed}",
            seed,
            {"strategy": strategy, "function": function, "dimensions": d, "most": most},
            COSTS[strategy] * d,
        )
        for d in (DIMENSIONS[:1] if arguments.quick else DIMENSIONS)
        for function in FUNCTIONS
        for strategy in STRATEGIES
        for seed in range(arguments.seed, arguments.seed + arguments.seeds)
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Search once."""
    strategy, function, d, most = (cell.settings[name] for name in ("strategy", "function", "dimensions", "most"))
    evaluations, us = trial(strategy, function, d, cell.seed, most)
    return {"evaluations": min(evaluations, most), "found": evaluations <= most, "us": us}


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep; raises CmaMissing before anything is begun."""
    load_cma()
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Evaluations against dimensions."""
    return draw(load_cells(folder), folder / "nes.png")
