"""Motor babbling (thesis 4.1.1): random position moves of 23 motors at 20 % speed, a table in front of the robot.

Claim: without MoBeE the robot hits itself and the table hundreds of times in two hours; with MoBeE it never does, and the second
MoBeE lets more of the commands happen, and more smoothly, than the first.  Source: thesis 4.1.1; published: "approximately two
hours over several trials of 5 to 20 minutes each with joint velocity limited to 20% of maximum ... MoBeE effectively prevented all
of them", on the robot.  Here: the PyBullet robot, every process in lockstep, postures uniform over the whole ranges of torso (3
motors), head with eyes (6) and arms without hands (7 each), the same sequence in all modes.  A command is a posture of one part; it
is completed when all its motors end within 10 degrees, returned when the part ends where it began, else deflected.

Run time: 2 h of robot time in each of three modes take about an hour; a run that was broken off goes on with --resume.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from experiments.babbling.figure import draw
from experiments.babbling.measured import POSITIONS, Trial, measure, read_trial, write_trial
from experiments.babbling.modes import MODES, RATE, TITLES
from experiments.babbling.moved import ROBOT
from experiments.babbling.results import summarise, verdict
from experiments.babbling.table import as_table
from experiments.babbling.trial import TrialFailed, run_trial
from experiments.kit.options import positive_number
from experiments.kit.progress import Progress
from mobee import load_robot
from mobee.errors import InvalidValue
from mobee.robot.robot import Robot

NAME = "babbling"
CLAIM = "random position moves break nothing under MoBeE, and 2.0 deflects them less than 1.0"
SOURCE = "thesis 4.1.1"

TRIAL = "trial.json"
SEEDS = 10_000  # trials a seed
TRIES = 3  # of a trial in which somebody was late for a tick, which the robot does not forgive


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--minutes", type=positive_number, default=120.0, metavar="M", help="of robot time in each mode (default: 120)")
    parser.add_argument("--trial", type=positive_number, default=10.0, metavar="M", help="robot time of a trial (default: 10)")
    parser.add_argument("--modes", nargs="+", choices=MODES, default=list(MODES), metavar="MODE", help=f"of {', '.join(MODES)}")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Run the trials that are not there yet; returns the table, and whether the claims stand."""
    robot = load_robot(ROBOT)
    lengths = trial_lengths(arguments.minutes, arguments.trial)
    total, done = len(lengths) * len(arguments.modes), 0
    with Progress() as progress:
        for number, minutes in enumerate(lengths):
            for mode in arguments.modes:
                place = folder / mode / f"{number:03}"
                if not (place / TRIAL).exists():
                    text = f"{TITLES[mode]}, trial {number + 1} of {len(lengths)}"
                    seed, ticks = SEEDS * arguments.seed + number, round(60.0 * minutes * RATE)
                    _run_until_repeatable(place, mode, robot, seed, ticks, _shower(progress, done, total, text))
                done += 1
    rows = {mode: summarise(read_trials(folder, mode)) for mode in arguments.modes}
    judged = verdict(rows)
    if not arguments.json:
        print(as_table(rows))
    return {"passed": all(judged.values()), "judged": judged, **({"modes": rows} if arguments.json else {})}


def _run_until_repeatable(place: Path, mode: str, robot: Robot, seed: int, ticks: int, show: Callable[[float], None]) -> None:
    """Leave a trial in which nobody was late for a tick; raises TrialFailed."""
    for _ in range(TRIES):
        run_trial(place, mode, robot, seed, ticks, show)
        trial = measure(place, robot, 1.0 / RATE)
        if trial.lockstep.repeatable:
            write_trial(place / TRIAL, trial)
            (place / POSITIONS).unlink()
            return
    raise TrialFailed(f"{mode}: in {TRIES} trials somebody was late for a tick: this machine is too busy; see {place / 'launch'}")


def _shower(progress: Progress, done: int, total: int, text: str) -> Callable[[float], None]:
    """Shows which share of all trials is done when it is told the share of the one under way."""
    return lambda share: progress.show((done + share) / total, text)


def trial_lengths(minutes: float, trial: float) -> list[float]:
    """The trials that make up so many minutes, in minutes; the last may be shorter."""
    whole = int(minutes / trial + 1e-9)
    rest = minutes - whole * trial
    return [trial] * whole + ([rest] if rest > 1e-6 * trial else [])


def read_trials(folder: Path, mode: str) -> list[Trial]:
    """All finished trials of a mode, in order."""
    return [read_trial(path) for path in sorted(folder.glob(f"{mode}/*/{TRIAL}"))]


def figure(folder: Path) -> Path:
    """Collisions by pair, their depths, and what became of the commands."""
    trials = {mode: found for mode in MODES if (found := read_trials(folder, mode))}
    if not trials:
        raise InvalidValue(f"{folder} has no finished trial: it was stopped before the first was over.")
    return draw({mode: summarise(found) for mode, found in trials.items()}, folder / "babbling.png")
