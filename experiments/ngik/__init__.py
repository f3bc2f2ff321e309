"""Natural gradient inverse kinematics: NES beside the optimisers that others used.

Claim: NES outperforms the other optimisation approaches at solving inverse kinematics for the iCub's 41 motors.
Source: thesis 3.1.1.  Published: no numbers.  Run time: 3 minutes on 2 cores.

The right palm goes to poses (place and rotation) of random postures among 100 boxes: 5 mm, 5 degrees, no contact; all 41 motors may
move, or torso and arm, 10.  Same cost for all; each ends at its first good pose, begins anew where it is stuck in a way of its own, and
gives up after 20 000 evaluations.  NES as in `solve_ik(method="nes")`; xNES as published (Glasmachers 2010); CMA-ES (package cma, a
generation at once); simulated annealing; a particle filter.  What counts are evaluations a target, those without success with all they
took: "outperforms" needs fewer than the rival's.  Each seed has targets of its own.  Times are processor time of one core.
"""

from __future__ import annotations

import argparse
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from experiments.bench.cma_peer import load_cma
from experiments.bench.ik_solvers import Solve, library, rival, timed
from experiments.bench.ik_workload import MOTORS, scene, targets
from experiments.kit.cells import Cell, load_cells
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.ngik.figure import draw
from experiments.ngik.findings import CLAIMS, FEW, NES, RIVALS, WHOLE, findings
from mobee import Model

NAME = "ngik"
CLAIM = "NES outperforms the other optimisers at solving inverse kinematics for the iCub's 41 motors"
SOURCE = "thesis 3.1.1"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

TARGETS = 20  # a seed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Every solver with either number of motors on every seed's targets; --quick: two targets."""
    count = 2 if arguments.quick else TARGETS
    return [
        Cell(f"{name}-{motors}-s{seed}", seed, {"solver": name, "motors": motors, "targets": count}, motors)
        for motors in (WHOLE, FEW)
        for name in (NES, *RIVALS)
        for seed in range(arguments.seed, arguments.seed + arguments.seeds)
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Solve the targets of a seed, one after another."""
    model, name = _model(), cell.settings["solver"]
    motors = MOTORS if cell.settings["motors"] == FEW else None
    solve: Solve = library(model, "nes", motors) if name == NES else rival(model, RIVALS[name], motors)
    count = cell.settings["targets"]
    aims, first = targets(model, count, cell.seed), cell.seed * count
    solve(aims[0], first)  # caches and lazy set-up
    reached, evaluations, ms = zip(*(timed(solve, aim, seed) for seed, aim in enumerate(aims, first)), strict=True)
    return {"reached": np.array(reached), "evaluations": np.array(evaluations), "ms": np.array(ms)}


@cache
def _model() -> Model:
    return scene()


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep; raises CmaMissing before anything is begun."""
    load_cma()
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """The share of targets reached against evaluations."""
    return draw(load_cells(folder), folder / "ngik.png")
