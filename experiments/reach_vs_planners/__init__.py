"""The learned reacher against inverse kinematics and RRT-Connect, which know the robot and the world.

Claim: the learned reacher is no worse than planning with a perfect model, under motor noise and to a moving target too; and single
query planning is too slow to be used online: 10 s for both arms around a table's edge to a cup, and 125 s of smoothing.
Source: thesis 1.5, 9.3.  Published: BT-RRT's 10 s and 125 s (Perez et al. 2011).  Run time: three minutes on 2 cores.

The right arm of today's robot under the default law; targets (where no joint limit pushes), starts and seeds are the same for both.  The
learner has 3000 curious transitions and 800 tries behind it and learns nothing here; the peer (experiments/kit/reaching/planner_peer.py)
knows the robot, its cables and the target's place, plans anew on every change, and is executed through MoBeE.  "noise": encoder noise of
0.5 degrees, five times the usual; "moving": the target goes to and fro by 5 to 12 cm at 3 cm/s and never rests.  Success: the palm within
2 cm of the surface; the learner may reach three times, the peer has 20 actions.  Plant time stands still while anybody plans; that is
told in processor time.
Where the target never rests, it is elsewhere after every motion of the peer, so that all but straight ways are planned anew at each corner,
and the last motion, of a second or more, aims where the target was when it began.  The learner's reach follows the target.  What is
compared there is following with aiming, and trying again; nobody predicts.
The two arms' problem is drawn anew for each query, as no drawing of it was published: so the times compare orders of magnitude only, and
today's processor with that of 2011.
Seed 0 was looked at while the peer was made: what is reported begins with --seed 1.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import Cell, load_cells
from experiments.kit.reaching.arm import LEARNED, PART, JudgedPlant, arm_belief
from experiments.kit.reaching.cases import EVERY, Attempt, Case, attempt, begun, make_cases, trained
from experiments.kit.reaching.planner_peer import PlannerPeer
from experiments.kit.reaching.targets import GOOD
from experiments.kit.sweep import run_cells, sweep_arguments
from experiments.prm_vs_mdp.ompl_roadmap import require_ompl
from experiments.reach_vs_planners.figure import draw
from experiments.reach_vs_planners.findings import CLAIMS, SCENES, claims, summary
from experiments.reach_vs_planners.two_arms import query
from mobee import MotorParameters
from mobee.reach import reward_of

NAME = "reach-vs-planners"
CLAIM = "the learned reacher is no worse than planning with a perfect model, also under noise and to moving targets"
SOURCE = "thesis 1.5, 9.3"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "cells", "figure", "run", "work"]

TRIES, CASES, QUERIES = 800, 40, 20
NOISE = np.deg2rad(0.5)  # rad


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the experiment."""
    sweep_arguments(parser)


def cells(arguments: argparse.Namespace) -> list[Cell]:
    """Of each seed: the cases of the right arm, and the queries of both arms."""
    cases: dict[str, Any] = (
        {"transitions": 500, "tries": 50, "cases": 4} if arguments.quick else {"transitions": LEARNED, "tries": TRIES, "cases": CASES}
    )
    queries = {"scene": "two arms", "queries": 3 if arguments.quick else QUERIES}
    found = []
    for seed in range(arguments.seed, arguments.seed + arguments.seeds):
        found += [Cell(f"cases-s{seed}", seed, {"scene": "cases", **cases}, 2.0), Cell(f"arms-s{seed}", seed, queries)]
    return found


def work(cell: Cell) -> dict[str, Any]:
    """Both in the same cases, arrays by "scene|who|measure"; or the queries, arrays by measure."""
    settings = cell.settings
    if settings["scene"] == "two arms":
        made = [query(1000 * cell.seed + number) for number in range(settings["queries"])]
        return {name: np.array([getattr(one, name) for one in made]) for name in ("found", "seconds", "smoothing", "corners", "missing")}
    agent = trained(cell.seed, settings["transitions"], settings["tries"], free=True)
    found: dict[str, Any] = {}
    for scene in SCENES:
        motors = replace(MotorParameters(), encoder_noise=NOISE) if scene == "noise" else None
        cases = make_cases("moving" if scene == "moving" else "free", settings["cases"], cell.seed, free=True)
        cases = [replace(case, to_and_fro=True) for case in cases]
        seeds = range(1000 * cell.seed, 1000 * cell.seed + len(cases))
        attempts = {
            "learner": [attempt("both", agent, case, seed, motors) for case, seed in zip(cases, seeds, strict=True)],
            "peer": [planned(case, seed, motors) for case, seed in zip(cases, seeds, strict=True)],
        }
        for who, each in attempts.items():
            found[f"{scene}|{who}|success"] = np.array([one.missing <= GOOD for one in each])
            for measure in ("missing", "seconds", "thinking"):
                found[f"{scene}|{who}|{measure}"] = np.array([getattr(one, measure) for one in each])
    return found


def planned(case: Case, seed: int, motors: MotorParameters | None) -> Attempt:
    """The peer in a case."""
    plant = JudgedPlant(begun(case, seed, motors))
    start = plant.time
    if case.to is not None:
        plant.inner.every(EVERY, lambda now: plant.present(case.seen_at(now - start)))
    peer = PlannerPeer(plant, arm_belief(case.world()), PART, "none", seed)
    tried = peer.try_problem(case.target, lambda: case.seen_at(plant.time - start))
    return Attempt(tried.missing, tried.seconds, tried.planning, reward_of(tried.missing))


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Work off all cells; returns the claims and the tables.  Raises OmplMissing before anything is begun."""
    require_ompl()
    run_cells(work, cells(arguments), folder, arguments)
    done = load_cells(folder)
    return {"claims": [claim.record() for claim in claims(done)], **summary(done)}


def figure(folder: Path) -> Path:
    """Success, planning time, and both arms."""
    return draw(load_cells(folder), folder / "reach-vs-planners.png")
