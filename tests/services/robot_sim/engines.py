# SPDX-License-Identifier: Apache-2.0
"""The back-ends with physics."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from mobee.model.world import World
from mobee.robot.robot import Robot
from mobee.simulation.motors import MotorParameters
from services.robot_sim.kinematic import Backend


class Engine(Protocol):
    """Makes a back-end."""

    def __call__(self, robot: Robot, load_world: Callable[[], World], parameters: MotorParameters, seed: int, dt: float) -> Backend: ...
