"""A ball, and a map of three poses with two ways from one side of it to the other: the short one leads through it."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

from mobee import AdaptiveRoadmap, Model, Space, load_robot, load_world
from mobee.robot.robot import Array, Robot

ROBOT, PART, MARKER = "icub", "right_arm", "right_palm"
BALL, RADIUS = "ball", 0.03
RIGHT, LEFT, ABOVE = 0, 1, 2  # vertices
POSES = (  # rad, shoulder and elbow; the wrist is straight
    (-0.41, 1.36, 0.84, 0.68),  # at the right of the ball
    (-1.22, 0.58, 0.94, 1.30),  # at its left
    (-1.14, 1.38, 0.30, 0.67),  # above it
)
GOALS = ((LEFT, ABOVE), (RIGHT, ABOVE), (RIGHT, LEFT))
WORLD = Path(__file__).with_name("ghost.xml")  # what the model knows
SIMULATED = Path(__file__).with_name("away.xml")  # what there is, until it is put there
RATE, SPEED = 100.0, 1.0  # Hz; share of the motors' speed


@cache
def robot() -> Robot:
    """The iCub."""
    return load_robot(ROBOT)


def new_map() -> AdaptiveRoadmap:
    """As it was made, nothing known."""
    arm = robot().parts[PART]
    samples = np.zeros((len(POSES), 7))
    samples[:, :4] = POSES
    low, high = robot().limits[arm.slice].T
    rest = np.clip((robot().home[arm.slice] - low) / (high - low), 0.0, 1.0)
    return AdaptiveRoadmap(Space(robot(), arm.motors[:7], samples, GOALS, rest.tolist()), both_ways=True)


def model() -> Model:
    """With the ball as a ghost."""
    return Model(robot(), load_world(str(WORLD)))


def ball() -> Array:
    """Its place, (3,) m."""
    return model().world.objects[BALL].position
