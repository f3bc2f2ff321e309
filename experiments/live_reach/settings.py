"""What is the same offline and live: the robot, its law, the arm that reaches, its states."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from experiments.babbling.modes import WORLD
from experiments.kit.reaching.arm import MARKER, PART
from experiments.kit.reaching.belief import PeerBelief
from mobee import Gains, Lattice, Model, MotorParameters, OfflinePlant, World, load_robot, load_world
from mobee.reach import Aim
from mobee.robot.robot import Robot

ROBOT, GAINS, RATE = "icub", "default", 50  # Hz
JOINTS, WRIST = 4, 7  # of the lattice; those of a reach, and of the planner
LEVELS, NEIGHBOURS = (0.25, 0.5, 0.75), 16
PREDICTOR, STRATEGY, FAILURES = "gp", "ucb", "alike"
GOOD = 0.02  # m from the target's surface
DEEP = 2e-3  # m, of a solid contact
REACHES = 3  # a try, each from another pre-reach state
APART = 0.25  # of the ranges: from states that far from one that missed a try expects no more, one step of the lattice
AIM: Aim = "surface"

__all__ = ["MARKER", "PART", "WORLD"]


@cache
def robot() -> Robot:
    """That of the live system."""
    return load_robot(ROBOT)


def world(path: Path = WORLD) -> World:
    """The table."""
    return load_world(str(path))


@cache
def space() -> Lattice:
    """81 states of shoulder and elbow."""
    return Lattice(robot(), robot().parts[PART].motors[:JOINTS], LEVELS, NEIGHBOURS)


def offline_plant(seed: int) -> OfflinePlant:
    """The arm with its wrist, at the table, with the motors that were identified on PyBullet."""
    motors = MotorParameters.identified(ROBOT)
    return OfflinePlant(Model(robot(), world()), seed, Gains.named(GAINS), motors, 1.0 / RATE, active=robot().parts[PART].motors[:WRIST])


def belief() -> PeerBelief:
    """What a planner knows: everything that MoBeE's model knows."""
    clauses = [clause for clause in robot().clauses if clause.part == PART]
    return PeerBelief(Model(robot(), world()), robot().parts[PART].motors[:WRIST], MARKER, clauses, Gains.named(GAINS))
