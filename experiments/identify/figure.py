"""Measured and fitted responses of some motors, what is left of them, and the numbers of all motors."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.identify.fitting import respond
from experiments.identify.recording import load
from experiments.identify.signals import DT, PRELOAD
from experiments.kit.plots import new_figure
from mobee.errors import InvalidValue
from mobee.robot.robot import Array, Robot
from mobee.simulation.motors import MotorParameters

SHOWN = ("torso_pitch", "l_shoulder_pitch", "l_elbow")
PUBLISHED = MotorParameters()
COLUMNS = (  # of the table, factor for the eye, label, published setting
    ("lag_s", 1e3, "lag [ms]", PUBLISHED.lag),
    ("delay_s", 1e3, "delay [ms]", PUBLISHED.delay),
    ("backlash_deg", 1.0, "backlash [deg]", np.rad2deg(PUBLISHED.backlash)),
    ("friction_deg_s", 1.0, "friction [deg/s]", np.rad2deg(PUBLISHED.friction)),
)


def draw(robot: Robot, files: Sequence[Path], table: Path, path: Path) -> Path:
    """Raises InvalidValue for a run that was stopped before its fit."""
    if not table.exists():
        raise InvalidValue(f"{path.parent} has no fit yet: go on with `mobee experiment run identify --resume {path.parent}`.")
    rows = list(csv.DictReader(table.read_text().splitlines()))
    parameters = _parameters(rows)
    by_motor = {file.stem: file for file in files}
    drawing = new_figure(12.0, 13.0)
    above, below = drawing.subfigures(2, 1, height_ratios=(1.0, 1.0))
    axes = above.subplots(2, len(SHOWN), sharex=True)
    for column, motor in enumerate(SHOWN):
        _draw_response(axes[:, column], robot, motor, by_motor[motor], parameters)
    for axis, column in zip(below.subplots(1, len(COLUMNS), sharey=True), COLUMNS, strict=True):
        _draw_numbers(axis, rows, *column)
    drawing.suptitle("The PyBullet robot's motors, identified from encoder readings alone")
    drawing.savefig(path, dpi=100)
    return path


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
        lag=columns["lag_s"],
        delay=columns["delay_s"],
        backlash=np.deg2rad(columns["backlash_deg"]),
        friction=np.deg2rad(columns["friction_deg_s"]),
        encoder_noise=0.0,
    )
