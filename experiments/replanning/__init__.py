"""Re-planning: the hand goes to the other side of a ball, and the ball is made solid on the way.

Claim: when the ball is made solid, "the planner/controller immediately finds the alternative path around it".  Source: thesis 4.3.2,
fig. 4.7.  Published: no number; aim of this reproduction: the new path under way within 200 ms of the bump, live, on robot_sim's clock.
Run time: 6 minutes on 2 cores, in real time.

The map has three poses of the right arm of `icub`, at the right of a ball, at its left, and above it; the way from right to left is shorter
through the ball than over it.  The real processes with PyBullet, in free mode, ticks of 10 ms, the default law at full speed.  Each
crossing begins on a map as it was made; 0.1 to 1.2 s after its start the ball becomes an obstacle in the model, and a body in the
simulator.  Bump: the first tick at which the model says that the arm touches the ball, fields included; the motion ends there, the
edge is out, and the arm goes on to the next vertex of the new way at once.  Under way: the first tick in which a command is in
force that knows of the new goal.  Besides, when the joints come no nearer to where the old way led, which is the law's doing.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from experiments.babbling.measured import CONTACTS, POSITIONS
from experiments.kit.options import positive_whole
from experiments.kit.progress import Progress
from experiments.replanning.figure import draw
from experiments.replanning.findings import CLAIMS, findings
from experiments.replanning.job import Job
from experiments.replanning.live import perform
from experiments.replanning.measured import MEASURED, Measured, keep_poses, measure, read_measured
from mobee.errors import InvalidValue

NAME = "replanning"
CLAIM = "when a ball turns solid on the way, the way around it is taken at once"
SOURCE = "thesis 4.3.2, fig. 4.7"
__all__ = ["CLAIM", "CLAIMS", "NAME", "SOURCE", "add_arguments", "figure", "run"]

SOONEST, LATEST = 0.1, 1.2  # s after the start of a crossing
PIECE = 5  # crossings of a launch


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--crossings", type=positive_whole, default=20, metavar="N", help="how many (default: 20)")
    parser.add_argument("--lockstep", action="store_true", help="in lockstep instead of real time: the same on any machine, however busy")
    parser.add_argument("--quick", action="store_true", help="a short version that shows whether it works")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Do the crossings that are not there yet."""
    after = np.random.default_rng([arguments.seed, 432]).uniform(SOONEST, LATEST, 2 if arguments.quick else arguments.crossings)
    pieces = [after[i : i + PIECE].tolist() for i in range(0, len(after), PIECE)]
    with Progress() as progress:
        for number, piece in enumerate(pieces):
            place = folder / f"launch-{number:03}"
            progress.show(number / len(pieces), f"launch {number + 1} of {len(pieces)}")
            if not (place / MEASURED).exists():
                perform(place, Job(piece), arguments.seed + number, arguments.lockstep)
                keep_poses(place)
                measure(place)
                for name in (POSITIONS, CONTACTS):
                    (place / name).unlink()
    return findings(_crossings(folder))


def figure(folder: Path) -> Path:
    """The hand through the ball and around it, as in thesis figure 4.7, and how soon."""
    crossings = _crossings(folder)
    return draw(sorted(folder.glob("launch-*")), crossings, folder / "replanning.png")


def _crossings(folder: Path) -> list[Measured]:
    found = [one for path in sorted(folder.glob(f"launch-*/{MEASURED}")) for one in read_measured(path.parent)]
    if not found:
        raise InvalidValue(f"{folder} has no finished launch: it was stopped before the first was over.")
    return found
