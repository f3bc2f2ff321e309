"""A small table that goes up and down in front of the robot, and is in the way of the left arm when it is up."""

from __future__ import annotations

import numpy as np

from experiments.kit.arm_learning import arm_plant
from mobee import Outcome, World, box
from mobee.robot.robot import Array, Robot

SIZE, PLACE = (0.3, 0.4, 0.12), (-0.45, -0.45)  # m: edges; x and y of its middle
DOWN, UP = -0.5, 0.31  # m, its top: out of reach, and at the height of the chest, where many a straight way of the arm ends in it
PERIOD = 10  # actions after which the table of a moving world is set anew


class TablePlant:
    """The arm's plant with the table, as a Plant; `moves`: the table is set up or down at random after every PERIOD actions."""

    def __init__(self, seed: int, moves: bool = False) -> None:
        world = World()
        world.add("table", box(*SIZE), position=_middle(DOWN))
        self.world, self.inner = world, arm_plant(seed, world=world)
        self.robot: Robot = self.inner.robot
        self._moves, self._rng, self._actions = moves, np.random.default_rng([seed, 741]), 0

    def set_top(self, height: float) -> None:
        """Put the table's top at that height [m]."""
        self.world.move("table", position=_middle(height))

    def measure(self, part: str) -> Array:
        """See Plant."""
        return self.inner.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """See Plant."""
        if self._moves and self._actions % PERIOD == 0:
            self.set_top(self._rng.choice((DOWN, UP)))
        self._actions += 1
        return self.inner.act(part, target)


def _middle(top: float) -> tuple[float, float, float]:
    return (*PLACE, top - SIZE[2] / 2.0)
