"""The maps of the pre-grasp task for the arm that walks on them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

import mobee
from experiments.trm.body import DOWN, RIGHT, RIGHT_ARM, UP
from experiments.trm.pregrasp import example
from mobee import Gains, Pose, Roadmap, Robot, costs
from mobee.robot.robot import Array

SPACINGS = (0.02, 0.012, 0.008, 0.0055, 0.0038, 0.0024)  # m
NEIGHBOURS = 8  # thesis 4.3.3
PART, CUP = "right_arm", "cup"
ABOVE = 0.06  # m, the height of the palm, 16 cm above the table: so high that nothing of the table is felt
RADIUS, HEIGHT, TOP = 0.02, 0.10, -0.10  # m, of a cup, which the hand feels from above, and of the table


@lru_cache(maxsize=2)
def built(spacing: float) -> Roadmap:
    """The map with that spacing [m], of poses in which MoBeE's fields and limits push nothing: there the arm rests where it is sent."""
    made = example()
    robot = made.model.robot

    def margin(pose: Pose, contacts: Any) -> Array:
        return _beyond(robot, pose.q)

    found = mobee.build_roadmap(
        made.model,
        costs=[
            costs.orientation(RIGHT, DOWN),
            costs.plane(RIGHT, UP, ABOVE),
            costs.collision(),
            costs.constraints(),
            costs.term(margin, tolerance=1e-3, name="margin"),
        ],
        task=made.task,
        spacing=spacing,
        start=made.start,
        motors=RIGHT_ARM,
        method="least_squares",
        neighbours=NEIGHBOURS,
    )
    at_home = np.repeat(robot.home[None], len(found.q), axis=0)
    arm = robot.parts[PART].slice
    at_home[:, arm] = found.q[:, arm]
    calm = np.array([not len(made.model.evaluate(q).table) for q in at_home])
    number, edges = np.cumsum(calm) - 1, found.edges[calm[found.edges].all(axis=1)]
    return Roadmap(made.model, at_home[calm], found.y[calm], number[edges], found.spacing, found.settings)


def _beyond(robot: Robot, q: Array) -> Array:
    """By how much the arm's joints are in the zones where limits push, in all, rad."""
    columns = [robot.motor_index(joint) for joint in RIGHT_ARM]
    width = np.broadcast_to(Gains.default().limit_width, (len(robot.motors),))[columns]
    low, high = robot.limits[columns].T
    beyond: Array = np.maximum(np.maximum(low + width - q[..., columns], q[..., columns] - high + width), 0.0).sum(axis=-1)
    return beyond
