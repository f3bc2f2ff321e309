# SPDX-License-Identifier: Apache-2.0
"""Settings of the torso assist."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from msgspec import Meta

from mobee.behaviours.assist import LEVELS, Assist, learned_worth, manipulability_worth
from mobee.learning.reaching.record import load_reaches
from mobee.model.model import Model
from mobee.robot.robot import Robot
from mobee.simulation.plant import OfflinePlant
from mobee.store import STORE
from services.common.behaviour import BehaviourConfig
from services.common.hands import hand_of
from services.common.worlds import world_around

LEARNED_LEVELS = 5  # positions of each motor that are compared by a learned map: a prediction takes milliseconds


class Config(BehaviourConfig, frozen=True, kw_only=True):
    """The torso assist's settings."""

    part: str = "torso"
    """Part that carries the arm."""
    arm: str = "right_arm"
    """Part that reaches."""
    world: str = ""
    """World whose objects the robot must not touch, as of the model: a shipped world, a file or none."""
    learned: str = ""
    """Folder of a run in which the arm has learned to reach, with the torso at home; empty: the arm's manipulability counts."""
    speed: Annotated[float, Meta(gt=0, le=1)] = 0.3
    """Share of the motors' speed with which the part moves."""

    def check_robot(self, robot: Robot) -> None:
        """Check also that the part carries the arm, and that the run can be read; raises MobeeError."""
        super().check_robot(robot)
        self.assist(robot)

    def assist(self, robot: Robot) -> Assist:
        """Return the object that chooses the postures, with the map that the settings name; raises MobeeError."""
        robot.part(self.arm)
        if self.learned:
            worth = learned_worth(load_reaches(Path(self.learned) / STORE, OfflinePlant(Model(robot)), self.arm).predictor)
        else:
            worth = manipulability_worth(robot, self.arm, hand_of(robot, self.arm), self.seed)
        levels = LEARNED_LEVELS if self.learned else LEVELS
        return Assist(Model(robot, world_around(self.world, self.robot)), self.part, self.arm, worth, levels)
