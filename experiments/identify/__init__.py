"""What motors has the PyBullet robot?  Lag, delay, backlash and friction of each, from responses to velocities alone.

Claim: the motor model of `mobee.simulation` with numbers fitted to what the encoders of the PyBullet robot say describes that robot,
gravity and inertia included: what is left of a response is its noise.  Source: thesis 2.2 (the robot does not do exactly what it is
told).  Nothing is published to compare with; the fit is compared with the numbers that the published findings need.
Run time: five minutes on a quiet machine, nearly all of it PyBullet's.

The robot is a black box: velocities go in, encoder positions with their noise come out.  The method is checked first, on
simulated motors whose numbers are known; held-out signals check the fit; at last an arm makes the same actions with PyBullet and with
the offline plant.  The raw responses stay in `responses/`, one file a motor; an interrupted run goes on behind them.
`identified.toml` is what `mobee/simulation/identified/` ships.  No finding is looked at.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from experiments.identify.body import chatter_aside, make_body
from experiments.identify.check import check_method
from experiments.identify.figure import draw
from experiments.identify.fitting import fit
from experiments.identify.recording import load, postures, record, save
from experiments.identify.report import csv_table, summary, toml_data
from experiments.identify.reproduce import reproduce
from experiments.identify.signals import fitted_signal, held_out_signal
from experiments.kit.options import positive_whole, whole_from_two
from experiments.kit.progress import Progress
from experiments.kit.run_folder import write
from mobee import Model, World, load_robot
from mobee.robot.robot import Robot

NAME = "identify"
CLAIM = "the motor model, fitted to encoder readings alone, explains the PyBullet robot to within the encoders' noise"
SOURCE = "thesis 2.2: the robot does not do exactly what it is told"

RESPONSES, TABLE, DATA, METHOD = "responses", "motors.csv", "identified.toml", "method.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    text = "of each signal in each posture, 2 or more: they differ by the noise alone (default: 2)"
    parser.add_argument("--repetitions", type=whole_from_two, default=2, metavar="N", help=text)
    parser.add_argument("--postures", type=positive_whole, default=3, metavar="N", help="home and N - 1 others (default: 3)")
    parser.add_argument("--actions", type=positive_whole, default=20, metavar="N", help="of an arm, to compare the plants (default: 20)")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Check the method, record, fit, compare."""
    robot = load_robot("icub")
    method = _check(arguments, robot, folder / METHOD)
    with chatter_aside():
        files = _record(arguments, robot, folder / RESPONSES)
    loaded = [load(file) for file in files]
    found = fit(robot, [responses for responses, _ in loaded], loaded[0][1])
    (folder / TABLE).write_text(csv_table(robot, found))
    (folder / DATA).write_text(toml_data(robot, found, arguments.seed))
    with chatter_aside():
        compared = reproduce(robot, found, arguments.actions, arguments.seed)
    return {"passed": method["passed"], "method": method, **summary(robot, found), "reproduced": compared}


def figure(folder: Path) -> Path:
    """Measured and fitted responses, and the numbers with their uncertainty."""
    robot = load_robot("icub")
    return draw(robot, [folder / RESPONSES / f"{motor}.npz" for motor in robot.motors], folder / TABLE, folder / "identify.png")


def _check(arguments: argparse.Namespace, robot: Robot, file: Path) -> dict[str, Any]:
    if not file.exists():
        write(file, check_method(robot, arguments.postures, arguments.repetitions, arguments.seed))
    found: dict[str, Any] = json.loads(file.read_text())
    return found


def _record(arguments: argparse.Namespace, robot: Robot, folder: Path) -> list[Path]:
    folder.mkdir(exist_ok=True)
    files = [folder / f"{motor}.npz" for motor in robot.motors]
    signals = fitted_signal(), held_out_signal(np.random.default_rng(arguments.seed))
    model, body = Model(robot, World()), make_body(robot, arguments.seed)
    with Progress() as progress:
        for motor, file in enumerate(files):
            progress.show(motor / len(files), f"recording {robot.motors[motor]}")
            if file.exists():
                continue
            at = postures(model, motor, arguments.postures, np.random.default_rng([arguments.seed, motor]))
            body.reset(arguments.seed)
            save(file, record(body, robot, motor, at, signals, arguments.repetitions), at, signals)
    return files
