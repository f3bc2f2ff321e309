# SPDX-License-Identifier: Apache-2.0
"""Runs the gaze: turns the cameras of the robot to a target."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mobee.arrays import Array
from mobee.robot.robot import Robot
from services.common.behaviour import Behaviour, Scene
from services.common.rate import NOT_MEASURED, Percentiles
from services.common.service import Service
from services.gaze.config import Config


class GazeNode:
    """Turns the cameras so that a target (an object that vision finds, or a marker of the robot) is in the middle of the pictures."""

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._gaze, self._errors = config.gaze(robot), Percentiles()
        self._behaviour = Behaviour(service, config, robot, self._step, self._gaze.reset, watches_last_place=True)
        service.mark, service.describe = self._mark, self._describe

    def _step(self, scene: Scene) -> tuple[Array, Array]:
        moved = self._gaze.step(scene.q, scene.velocity, scene.place, scene.place_velocity, scene.dt)
        self._errors.add(float(np.rad2deg(moved.error)))
        return moved.q, moved.velocity

    def _mark(self) -> None:
        self._errors.clear()
        self._behaviour.mark()

    def _describe(self) -> tuple[str, Mapping[str, float]]:
        numbers = self._behaviour.numbers()
        errors = {f"error_deg_p{p}": self._errors.at(p) if numbers["steps"] else NOT_MEASURED for p in (50, 99)}
        return self._behaviour.status, {**numbers, **errors}
