# SPDX-License-Identifier: Apache-2.0
"""Records the responses of the PyBullet robot's motors: commanded velocities [rad/s] and the resulting encoder values of every tick."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mobee import MotorParameters, World
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.model import Model
from mobee.robot.robot import Robot
from services.robot_sim.kinematic import Backend, BackendUnavailable

DT = 0.01  # s, a tick
ROOM = np.deg2rad(14.0)  # rad, largest distance of a signal from its start
SPEEDS = np.deg2rad([5.0, 10.0, 20.0, 40.0])  # rad/s, of the steps
REACH = np.deg2rad(11.0)  # rad, bound of a random signal, without lag
PRELOAD = 60  # ticks at the beginning that take up the play in the positive direction; not fitted

TRAVEL = 250  # ticks to move to a posture
RETURN = 60  # ticks to move back to the start of a signal
ARRIVED = np.deg2rad(1.0)  # rad
SHARE = 0.4  # of the distance from home to a random posture of the whole range
TRIES = 1000
ALL = slice(None)


def fitted_signal() -> Array:
    """Return the signal to which the model is fitted, (ticks,) rad/s.

    It has steps of four sizes and both signs, reversals without rest, and slow ramps through zero.
    """
    parts = [_preload()]
    for speed in SPEEDS:
        parts += [_hold(speed, 0.3), _hold(0.0, 0.3), _hold(-speed, 0.3), _hold(0.0, 0.3)]
    swing = np.deg2rad(10.0)
    parts += [_hold(swing, 0.2), *(_hold(sign * swing, 0.4) for sign in (-1.0, 1.0) * 3), _hold(-swing, 0.2), _hold(0.0, 0.3)]
    slow = np.deg2rad(4.0)
    up, down = np.linspace(-slow, slow, 150), np.linspace(slow, -slow, 150)
    parts += [up, down, _hold(0.0, 0.3)]
    return np.concatenate(parts)


def held_out_signal(rng: np.random.Generator) -> Array:
    """Return a signal of at least 4 s, (ticks,) rad/s, with random steps of random lengths; it checks the fit and is not used in it."""
    parts, position = [_preload()], 0.0
    while sum(map(len, parts)) * DT < 4.0:
        speed, duration = np.deg2rad(rng.uniform(-40.0, 40.0)), rng.uniform(0.05, 0.4)
        if position * speed > 0.0 and abs(position + speed * duration) > REACH:
            speed = -speed
        if rng.random() < 0.2 or abs(position + speed * duration) > REACH:
            speed = 0.0
        parts.append(_hold(speed, duration))
        position += speed * len(parts[-1]) * DT
    return np.concatenate(parts)


def _preload() -> Array:
    return np.concatenate([_hold(0.0, 0.1), _hold(np.deg2rad(5.0), 0.2), _hold(0.0, 0.3)])


def _hold(speed: float, duration: float) -> Array:
    return np.full(round(duration / DT), speed)


def make_body(robot: Robot, seed: int) -> Backend:
    """Return the PyBullet robot in an empty world; raises BackendUnavailable without PyBullet.

    `seed`: of the encoder noise.
    """
    try:
        from services.robot_sim.bullet import BulletBackend  # needs PyBullet, which is not available for every Python
    except ModuleNotFoundError as error:
        raise BackendUnavailable(f'identify needs the module {error.name!r}: pip install "mobee[sim]" on Python 3.11.') from error
    return BulletBackend(robot, World, MotorParameters(), seed, DT)


@contextmanager
def prints_to_stderr() -> Iterator[None]:
    """Redirect standard output to standard error in this context manager, because PyBullet's C code prints a line for every scene."""
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


@dataclass(frozen=True, slots=True, eq=False)
class Responses:
    """Encoder values [rad] of one motor at the beginning of every tick.

    `fitted` and `held_out`: responses to the fitted signal and to the held-out signal, each (postures, repetitions, ticks).
    """

    fitted: Array
    held_out: Array


def postures(model: Model, motor: int, count: int, rng: np.random.Generator) -> Array:
    """Return postures in which a motor has room for the signals, (count, n) rad.

    The first candidate is home; the others are random.  In each posture the motor can move by 14 degrees (ROOM) to either side without a
    limit or a contact.  If it is too near to a limit, its position is changed.  `motor`: its index.  Raises InvalidValue if too few
    postures are found.
    """
    robot = model.robot
    low, high = robot.limits.T
    found: list[Array] = []
    candidate = robot.home.copy()
    for _ in range(TRIES):
        candidate[motor] = np.clip(candidate[motor], low[motor] + ROOM, high[motor] - ROOM)
        swept = np.repeat(candidate[None], 5, axis=0)
        swept[:, motor] += np.linspace(-ROOM, ROOM, 5)
        if not np.any(model.evaluate(swept).count):
            found.append(candidate)
        if len(found) == count:
            return np.array(found)
        candidate = robot.home + SHARE * (rng.uniform(low, high) - robot.home)
    raise InvalidValue(f"{robot.motors[motor]}: only {len(found)} of {TRIES} postures are free; ask for fewer than {count}")


def record(body: Backend, robot: Robot, motor: int, at: Array, signals: tuple[Array, Array], repetitions: int) -> Responses:
    """Command both signals to one motor of `body`, and return its responses.

    `motor`: its index.  `at`: postures (postures, n) rad in which each signal starts.  `signals`: the fitted and the held-out signal,
    (ticks,) rad/s.  `repetitions`: how often each signal is commanded in each posture.  Raises InvalidValue if the robot cannot reach a
    posture.
    """
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
    """Write responses, postures and signals to a file, in SI units.  An interruption leaves no incomplete file.

    `at`: postures (postures, n) rad in which the signals start.  `signals`: the fitted and the held-out signal, (ticks,) rad/s.
    """
    unfinished = path.with_suffix(".part.npz")
    np.savez_compressed(
        unfinished, fitted=responses.fitted.astype(np.float32), held_out=responses.held_out.astype(np.float32), postures=at,
        fitted_signal=signals[0], held_out_signal=signals[1],
    )  # fmt: skip
    unfinished.rename(path)


def load(path: Path) -> tuple[Responses, tuple[Array, Array]]:
    """Read the responses and the two signals (ticks,) rad/s from a file that `save` wrote."""
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
        raise InvalidValue(f"{robot.motors[worst]} is {np.rad2deg(error[worst]):.1f} deg from the start posture: something blocks it")
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
