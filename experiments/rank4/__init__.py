"""Rank 4: which states of a large lattice can an arm never reach, and what becomes of the actions that aim at them?

Claim: of 256 states at 20, 40, 60 and 80 % of the joints' ranges the agent never reaches 60, 124, 188 and 252 and hardly ever 61,
125, 189 and 253, though it tries hundreds of times, for the cables of the shoulder turn it away; 57->61 ends in 62, 121->125 in
126, 249->253 in 254.  Of the lattice stretched to 12.5 and 87.5 % far more states are out of reach.  The arm often touches its
own body, and reaches its goal nevertheless.
Source: thesis 7.3, figs. 7.8 and 7.9; one run each, 14 597 and 26 963 actions.  Run time: 3 minutes on 2 cores.

The left arm from a random state, 50-50 initialisation, discount 0.9.  An action touches the own body if fields of two links overlap at any
time while it lasts.  State numbers: pitch fastest, then roll, yaw and elbow.
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.arm_learning import arm_plant, arm_space
from experiments.kit.cells import Cell, load_cells
from experiments.kit.exploration import begin_anywhere, explore
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.rank4.felt_plant import FeltPlant, SelfContact
from experiments.rank4.figure import draw
from experiments.rank4.findings import CLAIMS, findings
from experiments.rank4.runs import ACTIONS, LEVELS
from mobee import CuriousAgent

NAME = "rank4"
CLAIM = (
    "256 states: some are never reached, others hardly ever, since the cables turn actions aside, and more so when the lattice is stretched"
)
SOURCE = "thesis 7.3"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

QUICK = 0.2  # of the transitions


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Both lattices with every seed; the short version makes a fifth of the transitions."""
    share, name = (QUICK, "quick-") if arguments.quick else (1.0, "")
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    return [
        Cell(f"{name}{lattice}-s{seed}", seed, {"lattice": lattice, "transitions": round(share * ACTIONS[lattice])}, ACTIONS[lattice])
        for lattice, seed in product(LEVELS, seeds)
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Explore.

    Transitions (T, 3), values (256, 8); and of each transition the pair of links and the depth [m] of its deepest self-contact,
    -1 and 0 where there was none.
    """
    space, plant = arm_space(LEVELS[cell.settings["lattice"]]), arm_plant(cell.seed)
    begin_anywhere(space, plant, cell.seed)
    felt = FeltPlant(plant)
    agent = CuriousAgent(space, felt, seed=cell.seed)
    seen = explore(agent, cell.settings["transitions"])
    pairs, touching = _numbered(felt.felt)
    return {
        "seen": seen.astype(np.uint16),
        "values": agent.plan()[1].astype(np.float32),
        "pairs": pairs,
        "touching": touching,
        "depths": np.array([0.0 if contact is None else contact.depth for contact in felt.felt], dtype=np.float32),
    }


def _numbered(felt: list[SelfContact | None]) -> tuple[list[str], np.ndarray]:
    """The pairs of links that touched, and which of them did in each action, (T,)."""
    pairs = sorted({contact.pair for contact in felt if contact})
    touching = [-1 if contact is None else pairs.index(contact.pair) for contact in felt]
    return [" and ".join(pair) for pair in pairs], np.array(touching, dtype=np.int16)


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Outcomes, visits, tries and values of both lattices, as published, and where the unreachable states lie."""
    return draw(load_cells(folder), folder / "rank4.png")
