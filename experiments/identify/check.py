"""Does the method find what is there?  Motors with known numbers, drawn at random, must come back."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.identify.fitting import Fit, fit, respond
from experiments.identify.recording import Responses
from experiments.identify.signals import DT, fitted_signal, held_out_signal
from mobee.robot.robot import Array, Robot
from mobee.simulation.identified import FITTED
from mobee.simulation.motors import NOISE_PERIOD, MotorParameters

NOISE = np.deg2rad(0.1)  # rad at a tick of NOISE_PERIOD
UNLIKELY = 5.0  # standard deviations
UNIT = {"lag": ("s", 1.0), "delay": ("s", 1.0), "backlash": ("deg", 180.0 / np.pi), "friction": ("deg/s", 180.0 / np.pi)}


def known_motors(count: int, seed: int) -> MotorParameters:
    """Parameters all over their range, every third motor without friction, every fifth without play."""
    rng = np.random.default_rng([seed, 1])
    lag, delay = rng.uniform(0.01, 0.1, count), 0.005 * rng.integers(0, 9, count)
    backlash, friction = np.deg2rad(rng.uniform(0.0, 0.8, count)), np.deg2rad(rng.uniform(0.0, 2.0, count))
    friction[::3], backlash[::5] = 0.0, 0.0
    return MotorParameters(lag=lag, delay=delay, backlash=backlash, friction=friction, encoder_noise=0.0)


def synthetic(
    robot: Robot, parameters: MotorParameters, signals: tuple[Array, Array], shape: tuple[int, int], seed: int
) -> list[Responses]:
    """What motors with these parameters would answer, with encoder noise; `shape`: postures, repetitions."""
    rng = np.random.default_rng([seed, 2])
    sigma = NOISE * np.sqrt(NOISE_PERIOD / DT)
    clean = [respond(robot, parameters, signal) for signal in signals]
    return [
        Responses(*(each[motor] + sigma * rng.standard_normal((*shape, each.shape[1])) for each in clean))
        for motor in range(len(robot.motors))
    ]


def check_method(robot: Robot, postures: int, repetitions: int, seed: int) -> dict[str, Any]:
    """The largest errors over as many motors as the robot has, absolute and in their standard deviations."""
    signals = fitted_signal(), held_out_signal(np.random.default_rng(seed))
    known = known_motors(len(robot.motors), seed)
    found = fit(robot, synthetic(robot, known, signals, (postures, repetitions), seed), signals)
    table = {name: _errors(name, known, found) for name in FITTED}
    return {"passed": all(row["in_deviations"] < UNLIKELY for row in table.values()), **table}


def _errors(name: str, known: MotorParameters, found: Fit) -> dict[str, Any]:
    unit, factor = UNIT[name]
    error = np.abs(np.subtract(getattr(found.parameters, name), getattr(known, name)))
    return {"largest": float(error.max() * factor), "unit": unit, "in_deviations": float((error / found.deviation[name]).max())}
