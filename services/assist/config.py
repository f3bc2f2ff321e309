# SPDX-License-Identifier: Apache-2.0
"""Settings of the torso assist, which moves the torso so that an arm can reach a target well."""

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
    """The settings of the torso assist, which moves the torso so that an arm can reach a target well."""

    part: str = "torso"
    """Part that the assist moves; it carries the arm."""
    arm: str = "right_arm"
    """Part that reaches for the target."""
    world: str = ""
    """World with whose objects the robot must not collide: a shipped name, a file, or "none". Empty: the default world of the robot."""
    learned: str = ""
    """Folder of a run in which the arm has learned to reach with the torso at home: postures are then chosen by the learned rewards.
    Empty: they are chosen by the arm's manipulability."""
    speed: Annotated[float, Meta(gt=0, le=1)] = 0.3
    """Speed of the part, as a share of the motors' highest speed (0 to 1)."""

    def check_robot(self, robot: Robot) -> None:
        """Raise MobeeError if the settings do not fit the robot.

        This is so if no motor of `part` moves the base of the part `arm`, if the run of learning in the folder `learned` cannot be read, or
        if the name of a part cannot be used in keys of the bus.
        """
        super().check_robot(robot)
        self.assist(robot)

    def assist(self, robot: Robot) -> Assist:
        """Return the object that chooses the postures of the part, by learned rewards or by manipulability.

        The rewards are those of the run of learning in the folder `learned`. If `learned` is empty, manipulability is used. Raises
        MobeeError if the settings do not fit the robot, or the run cannot be read.
        """
        robot.part(self.arm)
        if self.learned:
            worth = learned_worth(load_reaches(Path(self.learned) / STORE, OfflinePlant(Model(robot)), self.arm).predictor)
        else:
            worth = manipulability_worth(robot, self.arm, hand_of(robot, self.arm), self.seed)
        levels = LEARNED_LEVELS if self.learned else LEVELS
        return Assist(Model(robot, world_around(self.world, self.robot)), self.part, self.arm, worth, levels)
