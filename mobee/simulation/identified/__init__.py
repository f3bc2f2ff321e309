# SPDX-License-Identifier: Apache-2.0
"""Motor models fitted to the responses of a robot, one TOML file per robot; `mobee experiment run motor-identification` makes them."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mobee.errors import InvalidValue, UnknownName

FOLDER = Path(__file__).parent
FITTED = ("lag", "delay", "backlash", "friction")


def identified_robots() -> tuple[str, ...]:
    """Return the names of the robots whose motors have been identified, sorted."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


def load_identified(robot_name: str, motors: Sequence[str] | None = None) -> dict[str, Any]:
    """Return a dict from the names of arguments of `MotorParameters` to the identified values for a robot.

    They are lag [s], delay [s], backlash [rad] and friction [rad/s], each (n,) for n motors, and encoder_noise [rad]. `motors`: names of
    the robot's motors, in the order that the arrays will have; None: the order of the file. Raises UnknownName for a robot that has not
    been identified, and InvalidValue if the file has other motors.
    """
    if robot_name not in (known := identified_robots()):
        raise UnknownName("identified robot", robot_name, known)
    file = FOLDER / f"{robot_name}.toml"
    data = tomllib.loads(file.read_text(encoding="utf-8"))
    fitted = data["motors"]
    names = tuple(fitted) if motors is None else tuple(motors)
    if set(names) != set(fitted):
        odd = sorted(set(names) ^ set(fitted))
        raise InvalidValue(f"{file.name} holds other motors than the robot has, {', '.join(odd[:3])}: identify it again")
    columns = {name: np.array([float(fitted[motor][name]) for motor in names]) for name in FITTED}
    return {**columns, "encoder_noise": float(data["encoder_noise"])}
