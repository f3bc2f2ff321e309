"""The two learners that are compared: an arm and the torso, each alone."""

from __future__ import annotations

from functools import cache

from experiments.kit.arm_learning import ARM_NEIGHBOURS, DT, TORSO, arm_plant, arm_space, robot, torso_space
from mobee import Gains, Lattice, Model, OfflinePlant


@cache
def space_of(part: str) -> Lattice:
    """81 states with 16 neighbours, or 27 with 8."""
    return torso_space() if part == "torso" else arm_space(neighbours=ARM_NEIGHBOURS)


def plant_of(part: str, seed: int) -> OfflinePlant:
    """The part's own motors, the rest of the body rigid, no objects."""
    if part == "torso":
        return OfflinePlant(Model(robot()), seed, Gains.published_2014(), dt=DT, active=TORSO)
    return arm_plant(seed)
