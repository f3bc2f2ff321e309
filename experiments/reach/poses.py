"""The poses that reaches begin at most often, with the targets (thesis fig. 8.3)."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.drawing.filmstrip import pictures_of
from experiments.drawing.picture import Picture
from experiments.drawing.scene import robot_solids
from experiments.drawing.solid import Solid, ball
from experiments.kit.reaching.arm import MARKER, PART, reach_space
from experiments.kit.reaching.targets import grid
from experiments.reach.runs import Runs
from mobee import Model

COUNT = 4
HEIGHT = 400  # pixels
PALM, TARGET = 0.014, 0.011  # m, radii of what stands for the palm and for a target, which are far larger
VEILED = 0.4
GOLD, GREEN = (0.96, 0.62, 0.0), (0.25, 0.65, 0.3)


def draw_poses(drawing: Any, mine: Runs) -> None:
    """The favourites at the last look, by how often they were chosen; seen from the front and the robot's right."""
    share = mine.chosen(mine.looks[-1]).mean(axis=0)
    states = np.argsort(-share)[:COUNT].tolist()
    for axes, state, picture in zip(drawing.subplots(1, COUNT), states, pictures(states), strict=True):
        axes.imshow(picture)
        axes.axis("off")
        axes.set_title(f"state {state}: {100.0 * share[state]:.0f} % of the reaches", fontsize=9)


def pictures(states: list[int]) -> list[Picture]:
    """The robot in each of the states, the palm in gold, the targets' centres in green."""
    return pictures_of([_scene(state) for state in states], "oblique", HEIGHT)


def _scene(state: int) -> list[Solid]:
    space = reach_space()
    q = space.robot.home.copy()
    q[space.robot.part(PART).slice] = space.target(state)
    pose = Model(space.robot).evaluate(q)
    targets = [ball(place, TARGET, GREEN, VEILED, group=-2) for place in grid()]
    return [*robot_solids(pose, [PART]), *targets, ball(pose.position(MARKER), PALM, GOLD, VEILED, group=-3)]
