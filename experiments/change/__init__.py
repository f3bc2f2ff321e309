"""Change: what does the curious agent do when its actions suddenly end elsewhere?

Claim: when actions that had always ended in one state suddenly end in another, they become very interesting, their value shoots up, the
agent tries them out a few times and so mends its model.  Ours: one that forgets old counts should mend it sooner.
Source: thesis 7.2.6 (there the simulator's instabilities were the cause, and few runs were looked at).  Published number: none.
Run time: 3 minutes on 2 cores.

The left arm on the lattice of rank 3.  After 3000 transitions a ball of 6 cm enters where the hand is in the middle state, or the
friction of the elbow doubles, from 4 deg/s, with which it arrives, to 8, with which it sticks; 3000 more follow, from home.  With
friction no action ever looks settled, for the controller goes on asking the motor: actions end after 8 s.  Which actions changed is
measured by walks through both worlds.  The model's error is that of debiased counts, L1, where they changed; what is left of it, and
how long half of it takes, are told of the error at the change itself, before the first transition after it.  Forgetting bounds an
action's counts, to 1 / (1 - forgetting), and so its reward from below: with 0.8 whatever has most outcomes stays the most interesting
for ever, and a curious agent tries little else.
"""

from __future__ import annotations

import argparse
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from experiments.change.figure import draw
from experiments.change.findings import CLAIMS, findings
from experiments.change.runs import BEFORE, CONDITIONS, EVERY
from experiments.change.worlds import CHANGES, groups, measure_outcomes, plant_of
from experiments.kit.arm_learning import arm_space
from experiments.kit.cells import Cell, load_cells
from experiments.kit.exploration import explore
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.kit.truth import Truth, l1, truth_of
from mobee import CuriousAgent
from mobee.errors import InvalidValue

NAME = "change"
CLAIM = "actions that suddenly end elsewhere become interesting, and are tried until the model is right again; sooner with forgetting"
SOURCE = "thesis 7.2.6"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

TRIES, WALK = 4, 9001  # of each action in a walk; its seed, which no run has
QUICK = 0.3  # of the transitions


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Every change with every agent and every seed; the short version makes a third of the transitions."""
    share, name = (QUICK, "quick-") if arguments.quick else (1.0, "")
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    return [
        Cell(
            f"{name}{change}-{explorer}-f{forgetting:g}-s{seed}",
            seed,
            {"change": change, "explorer": explorer, "forgetting": forgetting, "transitions": round(share * BEFORE)},
        )
        for change, (explorer, forgetting), seed in product(CHANGES, CONDITIONS, seeds)
    ]


def work(cell: Cell) -> dict[str, Any]:
    """Explore before and after the change.

    Returns transitions (T, 3); every so often error and value of what changed and of what did not, (looks, 4); and the error of
    what changed at the change, before anything was tried after it.
    """
    chosen, space = cell.settings, arm_space()
    truths = _truths(chosen["change"])
    changed, same = groups(*truths)
    if not changed.any():
        raise InvalidValue(
            f"the change {chosen['change']!r}: no action that could be tried before and after ends elsewhere; make it larger."
        )
    agent = CuriousAgent(
        space, plant_of(chosen["change"], False, cell.seed), chosen["explorer"], cell.seed, forgetting=chosen["forgetting"]
    )
    seen, series = [], []
    for is_after in (False, True):
        if is_after:
            agent.plant = plant_of(chosen["change"], True, cell.seed + 1)
            agent.interrupt()
            at_change = float(np.mean(l1(agent.model.debiased(), truths[True])[changed]))
        for _ in range(chosen["transitions"] // EVERY):
            seen.append(explore(agent, EVERY))
            error, value = l1(agent.model.debiased(), truths[is_after]), agent.plan()[1]
            series.append([float(np.mean(numbers[which])) for numbers in (error, value) for which in (changed, same)])
    return {
        "seen": np.concatenate(seen).astype(np.uint16),
        "series": np.array(series),
        "at_change": at_change,
        "changed": changed,
        "same": same,
    }


@cache
def _truths(change: str) -> tuple[Truth, Truth]:
    """Before and after; the same in every process, which needs it but once."""
    before, after = (truth_of(arm_space(), measure_outcomes(change, is_after, TRIES, WALK)) for is_after in (False, True))
    return before, after


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do what is left of the sweep."""
    run_cells(work, cells(arguments), folder, arguments)
    return findings(load_cells(folder))


def figure(folder: Path) -> Path:
    """Tries, value and error of what changed, over time."""
    return draw(load_cells(folder), folder / "change.png")
