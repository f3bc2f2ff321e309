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
    """A back-end, and a message for the user about an unexpected choice, or ""."""

    name: Name
    warning: str = ""


def choose(backend: Literal["auto", Name], robot: Robot) -> Choice:
    """Return the back-end for a robot; raises BackendUnavailable for one that cannot move it.

    "auto" is PyBullet for the iCub if it is installed, else MuJoCo if it is installed, else the motor model alone.
    """
    if backend == "pybullet":
        require_simulated(robot)
    if backend != "auto":
        return Choice(backend)
    if robot.name == SIMULATED and is_installed("pybullet"):
        return Choice("pybullet")
    return Choice("mujoco") if is_installed("mujoco") else Choice("kinematic", WITHOUT_PHYSICS)


def is_installed(name: Name) -> bool:
    """Return whether the packages of a back-end are installed."""
    return all(importlib.util.find_spec(package) is not None for package in PACKAGES[name])
