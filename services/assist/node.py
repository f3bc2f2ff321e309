# SPDX-License-Identifier: Apache-2.0
"""Runs the torso assist: chooses the posture of the torso from which an arm reaches a target best, and moves the torso there."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mobee.arrays import Array
from mobee.behaviours.gaze import LAG
from mobee.behaviours.tracking import Reference
from mobee.robot.robot import Robot
from services.assist.config import Config
from services.common.behaviour import Behaviour, Scene
from services.common.rate import NOT_MEASURED
from services.common.service import Service

AT_REST, RESTED = 0.05, 1.0  # m/s below which the target is at rest; s for which it must be, before the torso moves
MOVED = 0.03  # m by which the target must have moved for another choice


class AssistNode:
    """Moves a part, usually the torso, slowly to the posture from which an arm reaches a target best.

    The target is an object that vision finds, or a marker (named point of a link). A new posture is chosen when the target has moved by
    more than 3 cm and has then been at rest for 1 s.
    """

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self._config, self._robot, self._assist = config, robot, config.assist(robot)
        self._span = robot.part(config.part).slice
        self._reference: Reference | None = None
        self._goal: Array | None = None  # (n_part,) rad
        self._chosen_for, self._rested = np.full(3, np.inf), 0.0  # m, place of the target; s for which it has been at rest
        self._worth = NOT_MEASURED
        self._behaviour = Behaviour(service, config, robot, self._step, self._reset)
        service.mark, service.describe = self._behaviour.mark, self._describe

    def _reset(self) -> None:
        self._reference = None

    def _step(self, scene: Scene) -> tuple[Array, Array]:
        low, high = self._robot.limits[self._span].T
        near = scene.q[self._span] + LAG * scene.velocity[self._span]
        if self._reference is None:
            self._reference = Reference(self._robot, self._span, near, low, high, self._config.speed)
        if self._goal is None:
            self._goal = near
        self._rested = self._rested + scene.dt if np.linalg.norm(scene.place_velocity) < AT_REST else 0.0
        if self._rested > RESTED and np.linalg.norm(scene.place - self._chosen_for) > MOVED:
            chosen = self._assist.posture(scene.q, scene.place)
            self._goal, self._worth, self._chosen_for = chosen.q, chosen.worth, scene.place
        self._reference.catch_up(self._goal, np.zeros(len(near)), near, scene.dt)
        return self._reference.q - LAG * self._reference.velocity, self._reference.velocity

    def _describe(self) -> tuple[str, Mapping[str, float]]:
        return self._behaviour.status, {**self._behaviour.numbers(), "worth": self._worth}
