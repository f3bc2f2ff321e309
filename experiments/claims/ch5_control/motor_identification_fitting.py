# SPDX-License-Identifier: Apache-2.0
"""Fits the motor model (mobee.simulation.motors) to responses (encoder values under known commands); checks the method in simulation.

Lag, delay, backlash, friction and encoder noise of every motor are fitted.  The model is simulated for all motors at once, because the
motors do not influence each other.  In the model, the response does not depend on the position in which a signal starts, so the mean of
each response is subtracted before the comparison.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from scipy.sparse import csr_array

from experiments.claims.ch5_control.motor_identification_recording import DT, PRELOAD, Responses, fitted_signal, held_out_signal
from mobee.arrays import Array
from mobee.robot.robot import Robot
from mobee.simulation.identified import FITTED
from mobee.simulation.motors import NOISE_PERIOD, MotorParameters, Motors

SHAPED = ("lag", "backlash", "friction")  # fitted at a fixed delay, which the model rounds to substeps
SCALE = np.array([0.05, np.deg2rad(0.2), np.deg2rad(0.2)])  # s, rad, rad/s
START = np.array([1.0, 1.0, 0.5])  # times SCALE
AWAY = 0.05  # times SCALE, least start value of a fit, since steps of a derivative are relative
LONGEST = 0.05  # s, longest delay
TOLERANCE = 1e-6  # relative change of chi-square at which a fit ends
DERIVATIVE_STEP = 1e-3  # times SCALE; shorter steps are disturbed by the kinks of play and friction

NOISE = np.deg2rad(0.1)  # rad at a tick of NOISE_PERIOD
UNLIKELY = 5.0  # standard deviations
UNIT = {"lag": ("s", 1.0), "delay": ("s", 1.0), "backlash": ("deg", 180.0 / np.pi), "friction": ("deg/s", 180.0 / np.pi)}


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Fitted values of n motors, and the quality of the fit.

    `parameters`: fitted motor parameters.  `deviation`: dict from a parameter's name ("lag", "delay", "backlash", "friction") to its
    standard deviations (n,) in s, s, rad and rad/s.  `noise`: standard deviation of the encoder noise, for ticks of 20 ms (NOISE_PERIOD),
    (n,) rad; for a tick of dt [s] it is sqrt(0.02 / dt) times this value.  `chi_square`: chi-square of the fitted responses per degree of
    freedom, (n,); 1 if the residuals are only encoder noise.  `misfit`: rms difference between the measured mean response and the fitted
    model, after the mean square of the noise was subtracted, (n,) rad.  `held_out_chi_square` and `held_out_misfit`: the same for signals
    that were not fitted.
    """

    parameters: MotorParameters
    deviation: dict[str, Array]
    noise: Array
    chi_square: Array
    misfit: Array
    held_out_chi_square: Array
    held_out_misfit: Array


def fit(robot: Robot, responses: Sequence[Responses], signals: tuple[Array, Array]) -> Fit:
    """Fit the motor model to the responses of all motors of a robot.

    `responses`: of each motor, in the order of `robot.motors`.  `signals`: the commanded velocities, (ticks,) rad/s, of the fitted signal
    and of the held-out signal, the same for all motors.
    """
    noise = np.array([_noise(each.fitted, each.held_out) for each in responses])  # at a tick of DT
    sigma = noise / np.sqrt(responses[0].fitted[..., 0].size)  # of the mean response
    measured, held_out = (_centred(np.array([q.mean(axis=(0, 1)) for q in kind])) for kind in zip(*map(_both, responses), strict=True))
    problem = _Problem(robot, signals[0], measured / sigma[:, None], sigma)
    x, delay, squares, delay_deviation = _best(problem, len(responses))
    chi_square = squares / (measured.shape[1] - len(SHAPED) - 2)
    excess = np.sqrt(np.maximum(chi_square, 1.0))  # unexplained residuals make the values less certain
    deviation = dict(zip(SHAPED, (problem.deviation(delay, x) * excess[:, None]).T, strict=True))
    parameters = _parameters(x, delay)
    left = (held_out - _centred(respond(robot, parameters, signals[1]))) / sigma[:, None]
    held_out_chi_square = np.square(left).mean(axis=1)
    return Fit(
        parameters,
        {**deviation, "delay": delay_deviation * excess},
        noise * np.sqrt(DT / NOISE_PERIOD),
        chi_square,
        sigma * np.sqrt(np.maximum(chi_square - 1.0, 0.0)),
        held_out_chi_square,
        sigma * np.sqrt(np.maximum(held_out_chi_square - 1.0, 0.0)),
    )


def respond(robot: Robot, parameters: MotorParameters, signal: Array) -> Array:
    """Return the positions of the motor model without encoder noise, (n, ticks) rad.

    `signal`: commanded velocity (ticks,) rad/s, the same for all motors.
    """
    motors = Motors(robot, parameters, 0, robot.limits.mean(axis=1))
    substeps = parameters.substeps(DT)
    q = np.empty((len(signal), len(robot.motors)))
    commanded = None
    for tick, speed in enumerate(signal.tolist()):
        q[tick] = motors.q
        if speed != commanded:
            motors.command(slice(None), "velocity", np.full(q.shape[1], speed))
            commanded = speed
        motors.move(substeps, DT / substeps)
    return q.T


class _Problem:
    """Residuals between the model and mean responses, in units of their noise."""

    def __init__(self, robot: Robot, signal: Array, measured: Array, sigma: Array) -> None:
        self._robot, self._signal, self._measured, self._sigma = robot, signal, measured, sigma
        motors, ticks = measured.shape
        rows = np.arange(motors * ticks)
        columns = (rows // ticks)[:, None] * len(SHAPED) + np.arange(len(SHAPED))
        ones = np.ones(columns.size, dtype=np.int8)
        self._sparsity = csr_array((ones, (rows.repeat(len(SHAPED)), columns.ravel())))  # a motor's rows depend on its own numbers

    def solve(self, delay: float, start: Array) -> Array:
        """Fit lag, backlash and friction of all motors at a fixed delay [s] by least squares; returns them, (n, 3).

        They are at least 0, and in units of SCALE, as is their start value `start` (n, 3).
        """
        motors = len(self._measured)
        found = least_squares(
            lambda x: self.residuals(delay, x.reshape(motors, -1)).ravel(),
            start.ravel(),
            bounds=(0.0, np.inf),
            jac_sparsity=self._sparsity,
            diff_step=DERIVATIVE_STEP,
            ftol=TOLERANCE,
        )
        x: Array = found.x.reshape(motors, -1)
        return x

    def residuals(self, delay: float | Array, x: Array) -> Array:
        """Return the response of the motor model minus the measured mean response, (n, ticks), in standard deviations of the noise.

        The ticks of the preload at the beginning are left out.  `delay`: of all motors, or (n,), s.  `x`: (n, 3), lag, backlash and
        friction in units of SCALE.
        """
        predicted = _centred(respond(self._robot, _parameters(x, delay), self._signal)) / self._sigma[:, None]
        difference: Array = predicted - self._measured
        return difference

    def deviation(self, delay: Array, x: Array) -> Array:
        """Return the standard deviations of the fitted lag [s], backlash [rad] and friction [rad/s] of n motors, (n, 3).

        They follow from the slopes of the residuals at the solution.  `delay`: (n,) s, the fixed delay of the fit.  `x`: (n, 3), the
        solution: lag, backlash and friction in units of SCALE.
        """
        here = self.residuals(delay, x)
        steps = DERIVATIVE_STEP * np.eye(len(SHAPED))
        slopes = np.stack([(self.residuals(delay, x + step) - here) / DERIVATIVE_STEP for step in steps], axis=-1)  # (n, ticks, 3)
        covariance = np.linalg.inv(np.swapaxes(slopes, 1, 2) @ slopes)
        spread: Array = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)) * SCALE
        return spread


def _both(responses: Responses) -> tuple[Array, Array]:
    return responses.fitted, responses.held_out


def _best(problem: _Problem, motors: int) -> tuple[Array, Array, Array, Array]:
    """Fit the motors at every delay up to LONGEST, and select for each motor the delay with the smallest sum of squared residuals.

    Returns four arrays: x (n, 3), the fitted lag, backlash and friction in units of SCALE; the delay (n,) s; the sum of squares (n,); and
    the standard deviation of the delay (n,) s.  `motors`: their number n.
    """
    delays = np.arange(0.0, LONGEST + 1e-9, _substep())
    x = np.tile(START, (motors, 1))
    found, squares = [], []
    for delay in delays:
        x = problem.solve(delay, np.maximum(x, AWAY))
        found.append(x)
        squares.append(np.square(problem.residuals(delay, x)).sum(axis=1))
    grid, each = np.array(squares), np.arange(motors)
    best = grid.argmin(axis=0)
    return np.array(found)[best, each], delays[best], grid[best, each], _delay_deviation(grid, best)


def _parameters(x: Array, delay: float | Array) -> MotorParameters:
    values = dict(zip(SHAPED, (x * SCALE).T, strict=True))
    return MotorParameters(delay=np.broadcast_to(delay, len(x)).tolist(), encoder_noise=0.0, **{n: v.tolist() for n, v in values.items()})


def _substep() -> float:
    return DT / MotorParameters().substeps(DT)


def _centred(q: Array) -> Array:
    """Return the responses `q` (n, ticks) without the first 60 ticks (PRELOAD), each minus its mean over the remaining ticks.

    The signal takes up the play of the motor in the first ticks, which are not fitted.
    """
    kept = q[:, PRELOAD:]
    centred: Array = kept - kept.mean(axis=1, keepdims=True)
    return centred


def _noise(*responses: Array) -> float:
    """Return the standard deviation of a motor's encoder noise at one tick [rad], estimated from repeated responses.

    First the mean over the ticks is subtracted from each repetition, then the mean response of all repetitions in the same posture.
    `responses`: arrays (postures, repetitions, ticks) rad.  The ticks of the preload at the beginning are left out.
    """
    squares, freedom = 0.0, 0
    for each in responses:
        kept = each[:, :, PRELOAD:]
        shape = kept - kept.mean(axis=2, keepdims=True)
        rest = shape - shape.mean(axis=1, keepdims=True)
        squares += float(np.square(rest).sum())
        freedom += kept.shape[0] * (kept.shape[1] - 1) * (kept.shape[2] - 1)
    return float(np.sqrt(squares / freedom))


def _delay_deviation(squares: Array, best: Array) -> Array:
    """Return the standard deviation of the fitted delay of each motor, (n,) s.

    It follows from the second difference of chi-square between neighbouring delays.  `squares`: sum of squared residuals (delays, n).
    `best`: index of the best delay of each motor, (n,).
    """
    motors, middle = np.arange(squares.shape[1]), best.clip(1, len(squares) - 2)
    curvature = squares[middle - 1, motors] + squares[middle + 1, motors] - 2.0 * squares[middle, motors]
    deviation: Array = _substep() * np.sqrt(2.0 / curvature)
    return deviation


def known_motors(count: int, seed: int) -> MotorParameters:
    """Draw random parameters of `count` motors.  Every third motor has no friction, and every fifth has no backlash.

    `seed`: of the draw.
    """
    rng = np.random.default_rng([seed, 1])
    lag, delay = rng.uniform(0.01, 0.1, count), 0.005 * rng.integers(0, 9, count)
    backlash, friction = np.deg2rad(rng.uniform(0.0, 0.8, count)), np.deg2rad(rng.uniform(0.0, 2.0, count))
    friction[::3], backlash[::5] = 0.0, 0.0
    values = {"lag": lag, "delay": delay, "backlash": backlash, "friction": friction}
    return MotorParameters(encoder_noise=0.0, **{name: value.tolist() for name, value in values.items()})


def synthetic(
    robot: Robot, parameters: MotorParameters, signals: tuple[Array, Array], shape: tuple[int, int], seed: int
) -> list[Responses]:
    """Return simulated responses, with encoder noise, of motors with these parameters, for each motor of the robot.

    `seed`: of the noise.  `signals`: the fitted and the held-out signal, (ticks,) rad/s.  `shape`: number of postures, number of
    repetitions.
    """
    rng = np.random.default_rng([seed, 2])
    sigma = NOISE * np.sqrt(NOISE_PERIOD / DT)
    clean = [respond(robot, parameters, signal) for signal in signals]
    return [
        Responses(*(each[motor] + sigma * rng.standard_normal((*shape, each.shape[1])) for each in clean))
        for motor in range(len(robot.motors))
    ]


def check_method(robot: Robot, postures: int, repetitions: int, seed: int) -> dict[str, Any]:
    """Fit simulated motors with known values, and compare the fit with these values.

    Returns the largest error of each parameter, absolute and in standard deviations, and "passed", whether all errors are less than 5
    standard deviations.  `postures`, `repetitions`: numbers of simulated postures and of repetitions at each.  `seed`: of the draw.
    """
    signals = fitted_signal(), held_out_signal(np.random.default_rng(seed))
    known = known_motors(len(robot.motors), seed)
    found = fit(robot, synthetic(robot, known, signals, (postures, repetitions), seed), signals)
    table = {name: _errors(name, known, found) for name in FITTED}
    return {"passed": all(row["in_deviations"] < UNLIKELY for row in table.values()), **table}


def _errors(name: str, known: MotorParameters, found: Fit) -> dict[str, Any]:
    unit, factor = UNIT[name]
    error = np.abs(np.subtract(getattr(found.parameters, name), getattr(known, name)))
    return {"largest": float(error.max() * factor), "unit": unit, "in_deviations": float((error / found.deviation[name]).max())}
