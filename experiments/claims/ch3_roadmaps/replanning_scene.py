"""The scene of `replanning`: a ball, a map of three poses whose shortest path leads through it, and the records of a job."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
from msgspec import Struct

from mobee import AdaptiveRoadmap, Model, Space, load_robot, load_world
from mobee.arrays import Array
from mobee.robot.robot import Robot

ROBOT, PART, MARKER = "icub", "right_arm", "right_palm"
BALL, RADIUS = "ball", 0.03
RIGHT, LEFT, ABOVE = 0, 1, 2  # vertices
POSES = (  # rad, shoulder and elbow; the wrist is straight
    (-0.41, 1.36, 0.84, 0.68),  # at the right of the ball
    (-1.22, 0.58, 0.94, 1.30),  # at its left
    (-1.14, 1.38, 0.30, 0.67),  # above it
)
GOALS = ((LEFT, ABOVE), (RIGHT, ABOVE), (RIGHT, LEFT))
WORLD = Path(__file__).with_name("replanning_ghost.xml")  # what the model knows
SIMULATED = Path(__file__).with_name("replanning_away.xml")  # what the simulator has, until the ball is moved there
RATE, SPEED = 100.0, 1.0  # Hz; share of the motors' speed


@cache
def robot() -> Robot:
    """The iCub."""
    return load_robot(ROBOT)


def new_map() -> AdaptiveRoadmap:
    """The map as it was made, nothing observed."""
    arm = robot().parts[PART]
    samples = np.zeros((len(POSES), 7))
    samples[:, :4] = POSES
    low, high = robot().limits[arm.slice].T
    rest = np.clip((robot().home[arm.slice] - low) / (high - low), 0.0, 1.0)
    return AdaptiveRoadmap(Space(robot(), arm.motors[:7], samples, GOALS, rest.tolist()), both_ways=True)


def model() -> Model:
    """The model with the ball as a ghost."""
    return Model(robot(), load_world(str(WORLD)))


def ball() -> Array:
    """The position of the ball, (3,) m."""
    return model().world.objects[BALL].position


class Job(Struct, frozen=True):
    """Crossings to make: after how many seconds of each the ball turns solid."""

    after: list[float]


class Acted(Struct, frozen=True):
    """A motion; ticks are robot_sim's."""

    vertex: int  # its target
    asked: int  # tick at which it was asked for
    commanded: int  # tick in which a command formed after the request was first in force
    bump: int  # tick at which the model first said that the arm touches the ball, -1: never
    ended: int  # tick at which its end was known
    thinking: float  # s of processor time between the end of the motion before and the request


class Crossing(Struct, frozen=True):
    """From the right of the ball to its left."""

    solid: int  # tick at which the ball was made solid
    motions: list[Acted]
