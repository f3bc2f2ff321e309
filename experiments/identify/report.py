"""What was found, as a table, as the file that the library ships, and in a few numbers."""

from __future__ import annotations

import time
from importlib import metadata
from typing import Any

import numpy as np

from experiments.identify.check import UNIT
from experiments.identify.fitting import Fit
from mobee.robot.robot import Robot
from mobee.simulation.identified import FITTED
from mobee.simulation.motors import NOISE_PERIOD, MotorParameters

DIGITS = {"lag": 5, "delay": 4, "backlash": 5, "friction": 5}  # after the point, s and rad
MADE_WITH = ("mobee", "pybullet", "icub-models", "numpy", "scipy")
HEADER = """\
# The motors of the PyBullet {robot}, as its encoders show them: made by `mobee experiment run identify`; not edited by hand.
# lag, delay [s], backlash [rad], friction [rad/s], encoder_noise [rad, at a tick of {period:g} s]; _deviation: standard deviations.
# See docs/plant.md.
"""


def csv_table(robot: Robot, fit: Fit) -> str:
    """A line a motor, s and degrees."""
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
    """The file for mobee/simulation/identified/."""
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
    """For each number: median, range and uncertainty over the motors, and how far it is from the published settings."""
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
    """One number for all encoders, rad."""
    return float(np.sqrt(np.square(fit.noise).mean()))
