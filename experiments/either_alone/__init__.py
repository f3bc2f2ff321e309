"""The coarse planner alone, the reactive reach alone, and both.

Claim: a coarse discrete planner with a reactive reach does more than either alone; the planner may have few states, the reach closes what
is left, and only together do they bring the hand from arbitrary poses around the targets.
Source: thesis 5.3, 8.2, 9.3.  Published: no numbers.  Run time: three minutes on 2 cores.

The right arm, that of 2014 under the published law and today's under the default one; 27 targets that the palm can touch, 19 of the
thesis' and others drawn between them, and arbitrary poses to begin in (no home pose, no lattice state).
"planner": the MDP leads to the state whose sample holds the palm nearest to the target, and there it ends.  "reach": the palm is drawn
to the target from where it is.  "both": a learner, after 3000 curious transitions and 800 tries without obstacles, plans to where it
expects most of a reach, and reaches; it learns nothing from these cases.  Both planners know what it has learned of transitions and of
what targets block, and remember within a case which transitions failed.
Under the default law who reached and missed reaches again, up to three times a case: planned from another state, alone from where it is.
Scenes: free space; the hand on the far side of the target, as seen from the shoulder; the arm within 3 cm of the object, the palm turned
away; a ball of 8 cm between hand and target, of which only MoBeE knows; a target that moves 5 to 12 cm at 3 cm/s.
What decides is success, the palm within 2 cm of the target's surface when the force ends; under the published law, whose reaches go to the
centre, as the thesis measured them: the reward of eq. 8.4.  The seeds draw all of it.  Seed 0 was looked at while the scenes were made:
what is reported begins with --seed 1.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from experiments.either_alone.figure import draw
from experiments.either_alone.findings import CLAIMS, LAWS, claims, summary
from experiments.kit.cells import Cell, load_cells
from experiments.kit.reaching.arm import LEARNED
from experiments.kit.reaching.cases import SCENES, WAYS, attempt, make_cases, trained
from experiments.kit.sweep import run_cells, sweep_arguments

NAME = "either-alone"
CLAIM = "a coarse planner with a reactive reach does more than either alone"
SOURCE = "thesis 5.3, 8.2, 9.3"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

TRIES, CASES = 800, 40


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the experiment."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Of each seed one a law: a learner, and all scenes."""
    settings = (
        {"transitions": 500, "tries": 50, "cases": 4} if arguments.quick else {"transitions": LEARNED, "tries": TRIES, "cases": CASES}
    )
    seeds = range(arguments.seed, arguments.seed + arguments.seeds)
    return [Cell(f"{law}-s{seed}", seed, settings | {"law": law}) for seed in seeds for law in LAWS]


def work(cell: Cell) -> dict[str, Any]:
    """Train the learner, and let all attempt the same cases; arrays by "scene|who|measure"."""
    settings, law = cell.settings, cell.settings["law"]
    agent = trained(cell.seed, settings["transitions"], settings["tries"], law)
    found: dict[str, Any] = {}
    for scene in SCENES:
        cases = make_cases(scene, settings["cases"], cell.seed, law)
        for way in WAYS:
            made = [attempt(way, agent, case, 1000 * cell.seed + number, law=law) for number, case in enumerate(cases)]
            for measure in ("missing", "seconds", "reward"):
                found[f"{scene}|{way}|{measure}"] = np.array([getattr(one, measure) for one in made])
    return found


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Work off all cells; returns the claims and the table."""
    run_cells(work, cells(arguments), folder, arguments)
    done = load_cells(folder)
    return {"claims": [claim.record() for claim in claims(done)], **summary(done)}


def figure(folder: Path) -> Path:
    """What each brings in each scene."""
    return draw(load_cells(folder), folder / "either-alone.png")
