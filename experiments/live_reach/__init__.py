"""Live reach: the learned reacher on the live PyBullet robot, in lockstep, beside the planner.

Claim: trained offline and refined live, it brings the palm to within 2 cm of the surface of at least 95 % of the thesis' 27 targets that
can be reached, and of 90 % of fresh random ones, from random poses, without a solid contact deeper than 2 mm.
Source: aim of this reproduction (thesis 8, 9.3).  Published: no number.  Run time: 10 to 25 minutes a start on 2 cores.

The robot `icub` at its table under the default law, seven joints of its right arm, ticks of 20 ms; PyBullet, with gravity.  A start: a
learner (gp, ucb, alike) of 3000 curious transitions and 800 tries of the 27 targets on the offline plant with the identified motors, then
54 live tries in the same record; then, without learning, each of the 27 and 50 fresh targets from a pose of its own, up to three
reaches a try.  The planner peer (inverse kinematics and RRT-Connect, planned anew on every change) has the same targets, poses and
robot, and the true model; the target repels nothing while it moves, for it plans around it.  Besides, 8 targets that move to and fro over
15 cm at 3 cm/s, and 8 with a ball of 8 cm, in model and simulator, that crosses the hand's way as fast.
A target can be reached if inverse kinematics finds a pose that holds limits and cables, with the palm within 2 cm of the surface, and in
which no solid touches anything but the hand the target (experiments/kit/reaching/README.md has which grid it is).  Fresh targets are such.
Judged by the simulator's joints, not by encoders: where the palm was when the force ended, or the planner held that it was there.
First motion is measured with ticks of 2 ms: from the tick of the request to the first in which another command is in force.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from experiments.babbling.measured import POSITIONS
from experiments.kit.options import positive_whole
from experiments.kit.progress import Progress
from experiments.live_reach.figure import draw
from experiments.live_reach.findings import CLAIMS, claims, misses, table
from experiments.live_reach.held_off import nearest_reach
from experiments.live_reach.job import Job
from experiments.live_reach.live import perform
from experiments.live_reach.measured import BLOCK, Block, measure, read_block, write_block
from experiments.live_reach.problems import fresh_problems, grid_problems, grid_targets, moving_problems, touchable
from experiments.live_reach.settings import AIM, GOOD, RATE, belief, offline_plant
from experiments.live_reach.training import TRANSITIONS, train
from mobee.errors import InvalidValue
from mobee.reach import ReachTarget
from mobee.roadmap.ompl_base import require_ompl
from mobee.store import STORE

NAME = "live-reach"
CLAIM = "the learned reacher puts the palm on what can be reached, live, and touches nothing else"
SOURCE = "aim of this reproduction; thesis 8, 9.3"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "figure", "run"]

TRIES, LIVE, FRESH_TARGETS, MOVING = 800, 54, 50, 8
PIECE = 27  # tries of a launch
FAST, FIRST = 500.0, 10  # Hz; reaches that are looked at for their first motion


@dataclass(frozen=True)
class Sizes:
    """How much is done of a start."""

    transitions: int = TRANSITIONS
    tries: int = TRIES
    live: int = LIVE
    grid: int = 27
    fresh: int = FRESH_TARGETS
    moving: int = MOVING
    first: int = FIRST


QUICK = Sizes(500, 30, 2, 2, 2, 1, 2)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the experiment."""
    parser.add_argument(
        "--starts", type=positive_whole, default=3, metavar="N", help="learners, with poses and fresh targets of their own (default: 3)"
    )
    parser.add_argument("--quick", action="store_true", help="a short version that shows whether it works")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Train, refine and evaluate; what is there already is not done again.  Raises OmplMissing before anything is begun."""
    require_ompl()
    sizes, starts = QUICK if arguments.quick else Sizes(), 1 if arguments.quick else arguments.starts
    with Progress() as progress:
        for number in range(starts):
            seed, place = arguments.seed + number, folder / f"start-{number}"
            place.mkdir(exist_ok=True)
            progress.show(number / starts, f"start {number + 1} of {starts}: learns offline")
            train(place / STORE, seed, sizes.transitions, sizes.tries)
            jobs = list(_jobs(place, seed, sizes))
            for done, (name, job, rate) in enumerate(jobs):
                progress.show((number + done / len(jobs)) / starts, f"start {number + 1} of {starts}: {name}")
                _do(place / name, job, seed, rate)
    blocks, known = _blocks(folder), _touchable()
    targets = grid_targets()
    left = frozenset(number for number in known if _nearest(tuple(targets[number].position.tolist()))[0] <= GOOD)
    return {
        "claims": [claim.record() for claim in claims(blocks, known, left)],
        "tries": table(blocks, known),
        "missed": misses(blocks, known, _why),
        "reachable": sorted(known),
        "held off by the robot's own fields": sorted(known - left),
        "repeatable": all(block.repeatable for block in blocks if block.kind != "moving"),  # what is moved is moved from outside
    }


def figure(folder: Path) -> Path:
    """Distances and times."""
    return draw(_blocks(folder), _touchable(), folder / "live-reach.png")


def _jobs(place: Path, seed: int, sizes: Sizes) -> Iterator[tuple[str, Job, float]]:
    """The blocks of a start in their order: name, what is done, ticks a second."""
    store = str((place / STORE).resolve())
    grid, fresh = grid_problems(seed)[: sizes.grid], fresh_problems(seed, sizes.fresh)
    for made in range(0, sizes.live, PIECE):
        yield f"refine-{made:03}", Job("refine", seed, store, tries=sizes.tries + min(made + PIECE, sizes.live)), RATE
    pieces = [grid, *(fresh[i : i + PIECE] for i in range(0, len(fresh), PIECE))]
    for who in ("learner", "peer"):
        for number, piece in enumerate(pieces):
            yield f"{who}-{number}", Job(who, seed, store, piece), RATE
    yield "moving", Job("moving", seed, store, moving_problems(seed, sizes.moving)), RATE
    yield "first", Job("first motion", seed, store, fresh[: sizes.first]), FAST


def _do(folder: Path, job: Job, seed: int, rate: float) -> None:
    if not (folder / BLOCK).exists():
        repeatable = perform(folder, job, seed, rate)
        write_block(folder, measure(folder, job, rate, repeatable))
        (folder / POSITIONS).unlink()


@cache
def _nearest(place: tuple[float, float, float]) -> tuple[float, str]:
    """How near a reach from any state comes to a target offline."""
    return nearest_reach(offline_plant(0), ReachTarget(np.array(place), aim=AIM))


def _why(place: tuple[float, float, float]) -> str:
    off, felt = _nearest(place)
    return f"offline the nearest reach from any state ends {1e3 * off:.0f} mm off" + (f", kept by {felt} mm" if off > GOOD else "")


def _blocks(folder: Path) -> list[Block]:
    blocks = [read_block(path.parent) for path in sorted(folder.glob(f"start-*/*/{BLOCK}"))]
    if not blocks:
        raise InvalidValue(f"{folder} has no finished block: it was stopped before the first was over.")
    return blocks


def _touchable() -> frozenset[int]:
    """Those of the 27 that can be reached."""
    known = belief()
    return frozenset(number for number, target in enumerate(grid_targets()) if touchable(known, target))
