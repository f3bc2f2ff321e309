"""The arm's world before and after something in it has changed."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from experiments.kit.arm_learning import arm_plant, arm_space, robot
from experiments.kit.truth import Truth, l1, walk
from mobee import Gains, Model, MotorParameters, OfflinePlant, World, sphere
from mobee.robot.robot import Array, Ints

CHANGES = ("object", "friction")
RADIUS = 0.06  # m, of the ball that enters where the hand is in the middle of the lattice
MIDDLE = 40
STICKY = "l_elbow"
FRICTION = np.deg2rad(4.0)  # rad/s, before it doubles
PATIENCE = 8.0  # s, timeout where friction is: a controller that goes on asking a motor that sticks never looks settled
MOST = 3_000  # actions of a walk, where not every state can be reached any more
DIFFERENT, SAME = 1.0, 0.2  # L1 of what an action did before to what it does after


def plant_of(change: str, is_after: bool, seed: int) -> OfflinePlant:
    """The left arm before or after an "object" has entered its space, or the elbow's "friction" has doubled; at home."""
    if change == "object":
        return arm_plant(seed, world=_ball() if is_after else None)
    published = Gains.published_2014()
    friction = np.zeros(len(robot().motors))
    friction[robot().motor_index(STICKY)] = FRICTION * (2.0 if is_after else 1.0)
    gains = replace(published, settle=replace(published.settle, timeout=PATIENCE))
    return arm_plant(seed, gains=gains, motors=MotorParameters(friction=tuple(friction.tolist())))


def _ball() -> World:
    """A ball around the palm in the middle state."""
    space, q = arm_space(), robot().home.copy()
    q[robot().part(space.part).slice] = space.target(MIDDLE)
    world = World()
    world.add("ball", sphere(RADIUS), position=Model(robot()).evaluate(q).position("left_palm"))
    return world


def measure_outcomes(change: str, is_after: bool, tries: int, seed: int) -> Ints:
    """Where the actions end, by a walk that tries each so often where it can get to: transitions (T, 3)."""
    return walk(arm_space(), partial(plant_of, change, is_after), tries, MOST, seed)


def groups(before: Truth, after: Truth) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which actions (S, A) do something else since the change, and which do what they did; neither where that is not known."""
    difference: Array = np.where(before.tries > 0, l1(before, after), np.nan)
    return np.nan_to_num(difference) >= DIFFERENT, np.nan_to_num(difference, nan=2.0) <= SAME
