"""Sensitivity: which numbers of the plant carry the findings about the shoulder, and which lose them?

Claim: on the lattice of rank 4 four states are never reached, four hardly ever, and the actions into these end one pitch level up;
on rank 3 the entries 15->24, 42->51 and 69->78 fail and 21->24 succeeds.  The numbers of the 2014 program carry all this; cable
forces and the threshold at which an action is called settled decide about it, delay, lag, backlash and a little noise do not.
Source: thesis 7.2.5, 7.3 (the findings); the study is ours.  Published number: none.  Run time: 6 minutes on 2 cores.

The left arm, curious, 5000 actions on rank 4 (20-80 %) and 3000 on rank 3 (25-75 %), one number changed at a time; the published
value is in brackets.  Carried: the four never reached, the other four at most 4 times each on average, no other state unreached,
90 % of the tries turned aside end one level up; the rank 3 entries fail in half of their tries, 21->24 in no more than 10 %.
Two seeds show which numbers matter; these are means of few runs, and the claims stay open with fewer than 5 (--seeds 5).
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.arm_learning import arm_space
from experiments.kit.cells import Cell, load_cells
from experiments.kit.exploration import begin_anywhere, newest
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.sensitivity.figure import draw
from experiments.sensitivity.findings import ACTIONS, CLAIMS, LEVELS, findings
from experiments.sensitivity.variants import VARIANTS
from mobee import CuriousAgent

NAME = "sensitivity"
CLAIM = "cable forces and the settle threshold decide which states of the shoulder are hard to reach; delay, lag and backlash do not"
SOURCE = "thesis 7.2.5, 7.3"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

QUICK = 0.1  # of the transitions


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser, seeds=2)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Every variant with every seed; the short version makes a tenth of the transitions."""
    share, name = (QUICK, "quick-") if arguments.quick else (1.0, "")
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    return [
        Cell(f"{name}{number:02d}-s{seed}", seed, {"variant": variant, "share": share})
        for (number, variant), seed in product(enumerate(VARIANTS), seeds)
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Explore both lattices; transitions (T, 3) of each, share of timeouts, mean duration of an action [s]."""
    values: dict[str, Any] = {}
    settled, durations = [], []
    for lattice, levels in LEVELS.items():
        space, plant = arm_space(levels), VARIANTS[cell.settings["variant"]].plant(cell.seed)
        begin_anywhere(space, plant, cell.seed)
        agent, seen = CuriousAgent(space, plant, seed=cell.seed), []
        for _ in range(round(cell.settings["share"] * ACTIONS[lattice])):
            agent.step()
            last = newest(agent)
            seen.append((last.s, last.a, last.s_next))
            settled.append(last.settled)
            durations.append(last.duration)
        values[lattice] = np.array(seen, dtype=np.uint16)
    return values | {"timeouts": float(1.0 - np.mean(settled)), "seconds": float(np.mean(durations))}


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """The table of variants, what is lost in red."""
    return draw(load_cells(folder), folder / "sensitivity.png")
