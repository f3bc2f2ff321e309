"""Drives one motor of a simulated body, and keeps what its encoder says."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from experiments.identify.signals import DT, ROOM
from mobee.errors import InvalidValue
from mobee.model import Model
from mobee.robot.robot import Array, Robot
from services.robot_sim.backend import Backend

TRAVEL = 250  # ticks for the way to a posture
RETURN = 60  # ticks for the way back to where the signal started
ARRIVED = np.deg2rad(1.0)  # rad
SHARE = 0.4  # of the way from home to a random posture of the whole range
TRIES = 1000
ALL = slice(None)


@dataclass(frozen=True, slots=True, eq=False)
class Responses:
    """Encoders [rad] of one motor at the beginning of every tick: (postures, repetitions, ticks)."""

    fitted: Array
    held_out: Array


def postures(model: Model, motor: int, count: int, rng: np.random.Generator) -> Array:
    """Home and random postures around it, rad, shape (count, n), in which the motor has its room and the robot touches nothing.

    Raises InvalidValue if there are not so many.
    """
    robot = model.robot
    low, high = robot.limits.T
    found: list[Array] = []
    candidate = robot.home.copy()
    for _ in range(TRIES):
        candidate[motor] = np.clip(candidate[motor], low[motor] + ROOM, high[motor] - ROOM)
        swept = np.repeat(candidate[None], 5, axis=0)
        swept[:, motor] += np.linspace(-ROOM, ROOM, 5)
        if not model.evaluate(swept).count.any():
            found.append(candidate)
        if len(found) == count:
            return np.array(found)
        candidate = robot.home + SHARE * (rng.uniform(low, high) - robot.home)
    raise InvalidValue(f"{robot.motors[motor]}: only {len(found)} of {TRIES} postures are free; ask for fewer than {count}")


def record(body: Backend, robot: Robot, motor: int, at: Array, signals: tuple[Array, Array], repetitions: int) -> Responses:
    """Both signals in each of the postures `at` (postures, n), again and again."""
    shape = (len(at), repetitions)
    fitted, held_out = np.empty((*shape, len(signals[0]))), np.empty((*shape, len(signals[1])))
    k = 0  # ticks since the body was made: the noise of the encoders depends on it
    for i, posture in enumerate(at):
        ticks = TRAVEL
        for repetition in range(repetitions):
            for signal, kept in zip(signals, (fitted, held_out), strict=True):
                k = _go(body, robot, posture, k, ticks)
                k = _drive(body, motor, signal, kept[i, repetition], k)
                ticks = RETURN
    return Responses(fitted, held_out)


def save(path: Path, responses: Responses, at: Array, signals: tuple[Array, Array]) -> None:
    """All in SI units; the file is there only when it is whole."""
    unfinished = path.with_suffix(".part.npz")
    np.savez_compressed(
        unfinished, fitted=responses.fitted.astype(np.float32), held_out=responses.held_out.astype(np.float32), postures=at,
        fitted_signal=signals[0], held_out_signal=signals[1],
    )  # fmt: skip
    unfinished.rename(path)


def load(path: Path) -> tuple[Responses, tuple[Array, Array]]:
    """The responses and the signals."""
    with np.load(path) as file:
        responses = Responses(file["fitted"].astype(float), file["held_out"].astype(float))
        return responses, (file["fitted_signal"], file["held_out_signal"])


def _go(body: Backend, robot: Robot, posture: Array, k: int, ticks: int) -> int:
    for _ in range(ticks):
        body.motors.command(ALL, "position", posture)
        body.step(DT)
    k += ticks
    error = np.abs(body.motors.encoders(k, DT) - posture)
    if error.max() > ARRIVED:
        worst = int(error.argmax())
        raise InvalidValue(
            f"{robot.motors[worst]} is {np.rad2deg(error[worst]):.1f} deg from the posture to start in: something is in its way"
        )
    return k


def _drive(body: Backend, motor: int, signal: Array, encoders: NDArray[np.float64], k: int) -> int:
    velocity = np.zeros(len(body.motors.q))
    where = slice(motor, motor + 1)
    for tick, speed in enumerate(signal.tolist()):
        encoders[tick] = body.motors.encoders(k + tick, DT, where)[0]
        velocity[motor] = speed
        body.motors.command(ALL, "velocity", velocity)
        body.step(DT)
    return k + len(signal)
