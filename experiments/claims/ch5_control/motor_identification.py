# SPDX-License-Identifier: Apache-2.0
"""Motor identification: lag, delay, backlash and friction of the PyBullet robot's motors, fitted to responses to velocities.

Claim: the motor model of `mobee.simulation`, with parameters that are fitted to the encoder readings of the PyBullet robot, describes that
robot, gravity and inertia included: the residuals of the responses are only encoder noise.  Source: thesis 2.2 (the robot does not follow
its commands exactly).  The thesis has no parameters.  The fit is compared with `MotorParameters()`, called the published setting: with it
this project reproduces the published findings.
Run time: five minutes on a quiet machine, nearly all of it PyBullet's.

The robot is a black box: velocities are its inputs, noisy encoder positions its outputs.  First the method is checked on simulated motors
with known parameters.  Signals that are not used in the fit check the result.  At the end an arm makes the same actions with PyBullet and
with the offline plant (the robot simulated in one process, with this motor model).  The raw responses are in `responses/`, one file per
motor; --resume continues an interrupted run after the last of them.  The run writes `identified.toml`, which is shipped in
`mobee/simulation/identified/`.
"""

from __future__ import annotations

import argparse
import csv
import json
import time
from collections.abc import Callable, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from experiments.claims.ch5_control.motor_identification_fitting import UNIT, Fit, check_method, fit, respond
from experiments.claims.ch5_control.motor_identification_recording import (
    DT,
    PRELOAD,
    fitted_signal,
    held_out_signal,
    load,
    make_body,
    postures,
    prints_to_stderr,
    record,
    save,
)
from experiments.kit.command_line import Progress, positive_whole, whole_from_two
from experiments.kit.experiment import Experiment, Steps
from experiments.kit.plots import new_figure, saved
from experiments.kit.run_folder import write
from mobee import Controller, Gains, Model, MotorParameters, OfflinePlant, World, load_robot
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.robot.robot import Robot
from mobee.simulation.identified import FITTED
from mobee.simulation.motors import NOISE_PERIOD
from services.robot_sim.kinematic import Backend

RESPONSES, TABLE, DATA, METHOD = "responses", "motors.csv", "identified.toml", "method.json"

PART = "left_arm"
ACTION = 300  # ticks per action; the default gains have a time constant of 0.4 s
MIDDLE = (0.25, 0.75)  # shares of the motors' ranges within which targets are drawn
WRIST = slice(0, 7)  # the motors of the arm that move; the fingers do not

DIGITS = {"lag": 5, "delay": 4, "backlash": 5, "friction": 5}  # decimals, s and rad
MADE_WITH = ("mobee", "pybullet", "icub-models", "numpy", "scipy")
HEADER = """\
# The motors of the PyBullet {robot}, as its encoders show them: made by `mobee experiment run motor-identification`; not edited by hand.
# lag, delay [s], backlash [rad], friction [rad/s], encoder_noise [rad, at a tick of {period:g} s]; _deviation: standard deviations.
# See docs/plant.md.
"""

SHOWN = ("torso_pitch", "l_shoulder_pitch", "l_elbow")
PUBLISHED = MotorParameters()
COLUMNS: tuple[tuple[str, float, str, Any], ...] = (  # column of the table, factor to the shown unit, label, published setting
    ("lag_s", 1e3, "lag [ms]", PUBLISHED.lag),
    ("delay_s", 1e3, "delay [ms]", PUBLISHED.delay),
    ("backlash_deg", 1.0, "backlash [deg]", np.rad2deg(PUBLISHED.backlash)),
    ("friction_deg_s", 1.0, "friction [deg/s]", np.rad2deg(PUBLISHED.friction)),
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command-line options of this experiment to the parser."""
    text = "of each signal in each posture, 2 or more, to measure the noise (default: 2)"
    parser.add_argument("--repetitions", type=whole_from_two, default=2, metavar="N", help=text)
    parser.add_argument("--postures", type=positive_whole, default=3, metavar="N", help="home and N - 1 others (default: 3)")
    parser.add_argument("--actions", type=positive_whole, default=20, metavar="N", help="of an arm, to compare the plants (default: 20)")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Identify the motors of the PyBullet robot from their responses, and compare its motions with those of the offline plant.

    First the fit is checked on simulated motors with known parameters.  Then the responses are recorded in `folder`, the motor model is
    fitted to them, and tables of the fitted values are written.  A result of the check and responses that are already in `folder` are used
    and not made again.

    Returns "passed" and "method", the result of the check; "parameters", "encoder_noise" and "residual", statistics of the fit as in
    `summary`; and "reproduced", the differences of motions as in `reproduce`.
    """
    robot = load_robot("icub")
    method = _check(arguments, robot, folder / METHOD)
    with prints_to_stderr():
        files = _record(arguments, robot, folder / RESPONSES)
    loaded = [load(file) for file in files]
    found = fit(robot, [responses for responses, _ in loaded], loaded[0][1])
    (folder / TABLE).write_text(csv_table(robot, found))
    (folder / DATA).write_text(toml_data(robot, found, arguments.seed))
    with prints_to_stderr():
        compared = reproduce(robot, found, arguments.actions, arguments.seed)
    return {"passed": method["passed"], "method": method, **summary(robot, found), "reproduced": compared}


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


class BodyPlant:
    """A control loop like that of `OfflinePlant`, but with another simulated body, such as PyBullet's.

    As in the live system, a command that is computed in a tick moves the body in the next tick.  `controller`: the controller of the loop.
    """

    def __init__(self, model: Model, body: Backend) -> None:
        self.controller = Controller(model, Gains.default())
        self._model, self._body, self._k = model, body, 0
        self._command: Array | None = None

    def tick(self) -> Array:
        """Run one tick of the control loop.  Returns the encoder values at its beginning, (n,) rad."""
        self._k += 1
        q = self._body.motors.encoders(self._k, DT)
        if self._command is not None:
            self._body.motors.command(slice(None), "velocity", self._command)
        self._command = self.controller.step(q, DT, self.controller.forces(self._model.evaluate(q))).velocity
        self._body.step(DT)
        return q


def reproduce(robot: Robot, fit: Fit, actions: int, seed: int) -> dict[str, Any]:
    """Run the same actions of an arm with PyBullet and with the offline plant, and compare the motions with PyBullet's.

    Returns a dict with four keys.  Three are the motors of the offline plant: "identified" (fitted), "published" (`MotorParameters()`) and
    "ideal" (without lag, delay, play and friction).  The fourth, "pybullet_with_other_noise", is a second run of PyBullet.  Each value is a
    dict of differences from the encoder values of the first run of PyBullet [deg]: "rms_deg" and "largest_deg", and, at the ends of
    actions, the mean "end_deg" and "largest_end_deg".  `fit`: the fitted motors.  `actions`: their number.  `seed`: of actions and noise.
    """
    model = Model(robot, World())
    targets = free_targets(model, actions, np.random.default_rng([seed, 3]))

    def bullet(noise_seed: int) -> Array:
        plant = BodyPlant(model, make_body(robot, noise_seed))
        return _trajectory(plant.tick, plant.controller, targets)

    def offline(motors: MotorParameters) -> Array:
        plant = OfflinePlant(model, seed, Gains.default(), motors, DT)

        def tick() -> Array:
            plant.tick()
            return plant.measure(PART)

        return _trajectory(tick, plant.controller, targets)

    there = robot.part(PART).slice
    reference = bullet(seed)[:, :, there]
    identified = identified_motors(fit)
    noise = identified.encoder_noise
    ideal = MotorParameters(lag=0.0, delay=0.0, backlash=0.0, encoder_noise=noise)
    others = {"identified": identified, "published": MotorParameters(), "ideal": ideal}
    found = {name: _difference(offline(motors) - reference) for name, motors in others.items()}
    return {**found, "pybullet_with_other_noise": _difference(bullet(seed + 1)[:, :, there] - reference)}


def identified_motors(fit: Fit) -> MotorParameters:
    """Return the fitted values as parameters of an offline plant's motors."""
    p = fit.parameters
    return MotorParameters(lag=p.lag, delay=p.delay, backlash=p.backlash, friction=p.friction, encoder_noise=encoder_noise(fit))


def free_targets(model: Model, count: int, rng: np.random.Generator) -> Array:
    """Draw `count` random postures of the left arm, (count, n_part) rad, in which no shapes of the robot are in contact."""
    robot, part = model.robot, model.robot.part(PART)
    low, high = robot.limits[part.slice][WRIST].T
    targets: list[Array] = []
    while len(targets) < count:
        q = robot.home.copy()
        target = q[part.slice]
        target[WRIST] = low + (high - low) * rng.uniform(*MIDDLE, len(low))
        if not model.evaluate(q).contacts:
            targets.append(target)
    return np.array(targets)


def _trajectory(tick: Callable[[], Array], controller: Controller, targets: Array) -> Array:
    """Run the actions; returns encoder readings (actions, ticks, ...) rad."""
    courses = []
    for target in targets:
        controller.set_attractor(PART, target)
        courses.append([tick() for _ in range(ACTION)])
    return np.array(courses)


def _difference(course: Array) -> dict[str, float]:
    """Summarise differences between two motions of the arm in a dict of the four numbers [deg] that `reproduce` describes.

    `course`: differences of the encoder values, (actions, ticks, n_part) rad.  Only the first 7 motors count, because the fingers rest.
    """
    moved = np.rad2deg(course[..., WRIST])
    ends = np.abs(moved[:, -20:].mean(axis=1))  # a mean, to average out the encoder noise
    return {
        "rms_deg": float(np.sqrt(np.square(moved).mean())),
        "largest_deg": float(np.abs(moved).max()),
        "end_deg": float(ends.mean()),
        "largest_end_deg": float(ends.max()),
    }


def csv_table(robot: Robot, fit: Fit) -> str:
    """Return the fit as a CSV table with a line for each motor, in s and degrees."""
    columns = [f"{name}_{UNIT[name][0].replace('/', '_')}" for name in FITTED]
    head = [column + suffix for column in columns for suffix in ("", "_deviation")]
    lines = [",".join(["motor", *head, "noise_deg", "chi_square", "misfit_deg", "held_out_chi_square", "held_out_misfit_deg"])]
    for i, motor in enumerate(robot.motors):
        row: list[float] = []
        for name in FITTED:
            row += [UNIT[name][1] * getattr(fit.parameters, name)[i], UNIT[name][1] * fit.deviation[name][i]]
        row += [np.rad2deg(fit.noise[i]), fit.chi_square[i], np.rad2deg(fit.misfit[i])]
        row += [fit.held_out_chi_square[i], np.rad2deg(fit.held_out_misfit[i])]
        lines.append(",".join([motor, *(f"{value:.5g}" for value in row)]))
    return "\n".join(lines) + "\n"


def toml_data(robot: Robot, fit: Fit, seed: int) -> str:
    """Return the fit as the text of a file for mobee/simulation/identified/, in SI units.  `seed`: noted in the file."""
    made = {"date": time.strftime("%Y-%m-%d"), "seed": seed, **{name: metadata.version(name) for name in MADE_WITH}}
    lines = [HEADER.format(robot=robot.name, period=NOISE_PERIOD), f"encoder_noise = {encoder_noise(fit):.6f}\n", "[made]"]
    lines += [f"{key} = {value}" if isinstance(value, int) else f'{key} = "{value}"' for key, value in made.items()]
    lines.append("\n[motors]")
    for i, motor in enumerate(robot.motors):
        values = [f"{name} = {getattr(fit.parameters, name)[i]:.{DIGITS[name]}f}" for name in FITTED]
        values += [f"{name}_deviation = {fit.deviation[name][i]:.{DIGITS[name]}f}" for name in FITTED]
        lines.append(f"{motor} = {{ {', '.join(values)} }}")
    return "\n".join(lines) + "\n"


def summary(robot: Robot, fit: Fit) -> dict[str, Any]:
    """Return statistics of the fit over all motors.

    "parameters": for each parameter a dict with its "unit"; "median", "lowest" and "highest" of the motors' values; "deviation", the median
    of their standard deviations; "published", the value of `MotorParameters()`; and "farthest_from_published_in_deviations", the largest
    distance of a motor's value from the published one, divided by the standard deviation of the motor's value.  "encoder_noise": found and
    published noise [deg].  "residual": median chi-square per degree of freedom, largest misfit [deg] and the motor that has it, for the
    fitted and for the held-out responses.
    """
    published, found = MotorParameters(), {}
    for name in FITTED:
        unit, factor = UNIT[name]
        values, deviation = np.array(getattr(fit.parameters, name)) * factor, fit.deviation[name] * factor
        default = float(getattr(published, name)) * factor
        found[name] = {
            "unit": unit,
            "median": float(np.median(values)),
            "lowest": float(values.min()),
            "highest": float(values.max()),
            "deviation": float(np.median(deviation)),
            "published": default,
            "farthest_from_published_in_deviations": float((np.abs(values - default) / deviation).max()),
        }
    noise = {"found_deg": float(np.rad2deg(encoder_noise(fit))), "published_deg": float(np.rad2deg(published.encoder_noise))}
    left = {
        "chi_square": float(np.median(fit.chi_square)),
        "largest_misfit_deg": float(np.rad2deg(fit.misfit.max())),
        "at": robot.motors[int(fit.misfit.argmax())],
        "held_out_chi_square": float(np.median(fit.held_out_chi_square)),
        "held_out_largest_misfit_deg": float(np.rad2deg(fit.held_out_misfit.max())),
        "held_out_at": robot.motors[int(fit.held_out_misfit.argmax())],
    }
    return {"parameters": found, "encoder_noise": noise, "residual": left}


def encoder_noise(fit: Fit) -> float:
    """Return one standard deviation of the encoder noise for the whole robot [rad]: the root mean square over the encoders of all motors.

    `fit`: the fitted motors; its field `noise` (n,) rad is the standard deviation of each encoder.  Both are values for control periods
    (ticks) of 20 ms (NOISE_PERIOD).  In the motor model the noise depends on the tick: for a tick of dt [s] its standard deviation is
    sqrt(0.02 / dt) times this value.
    """
    return float(np.sqrt(np.square(fit.noise).mean()))


def figure(folder: Path) -> Path:
    """Draw measured and fitted responses, and the fitted values with their uncertainty, to a file in `folder`; returns its path.

    Raises InvalidValue for a run without a fit.
    """
    table, robot = folder / TABLE, load_robot("icub")
    if not table.exists():
        raise InvalidValue(f"{folder} has no fit yet: continue with `mobee experiment run motor-identification --resume {folder}`.")
    rows = list(csv.DictReader(table.read_text().splitlines()))
    parameters = _parameters(rows)
    drawing = new_figure(12.0, 13.0)
    above, below = drawing.subfigures(2, 1, height_ratios=(1.0, 1.0))
    axes = above.subplots(2, len(SHOWN), sharex=True)
    for column, motor in enumerate(SHOWN):
        _draw_response(axes[:, column], robot, motor, folder / RESPONSES / f"{motor}.npz", parameters)
    for axis, (name, factor, label, published) in zip(below.subplots(1, len(COLUMNS), sharey=True), COLUMNS, strict=True):
        _draw_numbers(axis, rows, name, factor, label, published)
    drawing.suptitle("The PyBullet robot's motors, identified from encoder readings alone")
    return saved(drawing, folder, 100)


def _draw_response(axes: Any, robot: Robot, motor: str, file: Path, parameters: MotorParameters) -> None:
    responses, (signal, _) = load(file)
    index = robot.motor_index(motor)
    measured = np.rad2deg(_from_mean(responses.fitted.mean(axis=(0, 1))))
    fitted = np.rad2deg(_from_mean(respond(robot, parameters, signal)[index]))
    one = np.rad2deg(_from_mean(responses.fitted[0, 0]))
    t = np.arange(len(signal)) * DT
    axes[0].plot(t, one, color="0.75", linewidth=0.6, label="one reading")
    axes[0].plot(t, measured, color="tab:blue", linewidth=1.5, label=f"mean of {responses.fitted[..., 0].size}")
    axes[0].plot(t, fitted, color="tab:orange", linewidth=0.9, linestyle="--", label="fitted model")
    axes[0].set(title=motor, ylabel="position [deg]")
    axes[1].plot(t, measured - fitted, color="tab:blue", linewidth=0.6)
    axes[1].axvspan(0.0, PRELOAD * DT, color="0.92")
    axes[1].set(xlabel="time [s]", ylabel="mean - model [deg]")
    axes[0].legend(fontsize=7)


def _draw_numbers(axis: Any, rows: Sequence[dict[str, str]], name: str, factor: float, label: str, published: float) -> None:
    places = np.arange(len(rows))
    values, deviation = ([factor * float(row[key]) for row in rows] for key in (name, f"{name}_deviation"))
    axis.errorbar(values, places, xerr=2.0 * np.array(deviation), fmt=".", markersize=4, linewidth=0.8)
    axis.axvline(factor * published, color="0.6", linestyle=":")
    axis.set(xlabel=f"{label}, ± 2 deviations", yticks=places, yticklabels=[row["motor"] for row in rows], ylim=(len(rows) - 0.5, -0.5))
    axis.tick_params(axis="y", labelsize=7)


def _from_mean(q: Array) -> Array:
    kept: Array = q - q[PRELOAD:].mean()
    return kept


def _parameters(rows: Sequence[dict[str, str]]) -> MotorParameters:
    columns = {name: np.array([float(row[name]) for row in rows]) for name, *_ in COLUMNS}
    return MotorParameters(
        lag=columns["lag_s"].tolist(),
        delay=columns["delay_s"].tolist(),
        backlash=np.deg2rad(columns["backlash_deg"]).tolist(),
        friction=np.deg2rad(columns["friction_deg_s"]).tolist(),
        encoder_noise=0.0,
    )


EXPERIMENT = Experiment(
    claim="the motor model, fitted to encoder readings alone, explains the PyBullet robot to within the encoders' noise",
    source="thesis 2.2: the robot does not do exactly what it is commanded",
    method=Steps(add_arguments, run, figure),
)
