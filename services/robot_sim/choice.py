# SPDX-License-Identifier: Apache-2.0
"""Chooses the back-end: by name, or the installed one that is most suitable for the robot."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from mobee.robot.robot import Robot
from services.robot_sim.kinematic import SIMULATED, require_simulated

Name = Literal["pybullet", "mujoco", "kinematic"]
PACKAGES: Mapping[Name, tuple[str, ...]] = {"pybullet": ("pybullet", "icub_models"), "mujoco": ("mujoco",), "kinematic": ()}
EXTRA = "sim"  # of this project, which brings them
WITHOUT_PHYSICS = (
    "MuJoCo is not installed: the motor model alone moves the robot, without gravity and contacts. "
    f'For physics: pip install "mobee[{EXTRA}]"; to choose the motor model: backend = "kinematic"'
)


@dataclass(frozen=True, slots=True)
class Choice:
    """The chosen back-end.

    `name`: pybullet, mujoco or kinematic. `warning`: text for the user if the choice may be unexpected; otherwise empty.
    """

    name: Name
    warning: str = ""


def choose(backend: Literal["auto", Name], robot: Robot) -> Choice:
    """Return the back-end for a robot; raises BackendUnavailable if "pybullet" is given for a robot that it cannot move.

    `backend`: name of a back-end, or "auto". "auto" is PyBullet for the iCub if it is installed, otherwise MuJoCo if it is installed,
    otherwise the motor model alone ("kinematic").
    """
    if backend == "pybullet":
        require_simulated(robot)
    if backend != "auto":
        return Choice(backend)
    if robot.name == SIMULATED and is_installed("pybullet"):
        return Choice("pybullet")
    return Choice("mujoco") if is_installed("mujoco") else Choice("kinematic", WITHOUT_PHYSICS)


def is_installed(name: Name) -> bool:
    """Return whether the Python packages that a back-end needs are installed."""
    return all(importlib.util.find_spec(package) is not None for package in PACKAGES[name])
