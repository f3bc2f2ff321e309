"""What is the same offline and live: the arm, its map, its law."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from experiments.babbling.modes import WORLD
from mobee import AdaptiveRoadmap, Gains, MapExplorer, Model, MotorParameters, OfflinePlant, Plant, Voronoi, load_robot, load_world
from mobee.roadmap.adaptive.map_store import MapStore
from mobee.roadmap.ompl import query
from mobee.robot.robot import Robot

ROBOT, PART, MARKER = "icub", "right_arm", "right_palm"
JOINTS, SAMPLES, NEIGHBOURS = 7, 20, 10  # thesis 4.3.1: 20 and 10, of the whole upper body
RATE, SPEED = 50.0, 0.1  # Hz; share of the motors' speed, thesis 4.3.1
EXTENSIONS = 500  # of a single query
DEEP = 2e-3  # m, of a solid contact

__all__ = ["WORLD"]


@cache
def robot() -> Robot:
    """That of both."""
    return load_robot(ROBOT)


def model(world: Path = WORLD) -> Model:
    """The arm at its table."""
    return Model(robot(), load_world(str(world)))


def joints() -> tuple[str, ...]:
    """Of the map."""
    return robot().parts[PART].motors[:JOINTS]


def new_map(seed: int) -> AdaptiveRoadmap:
    """Random poses and their nearest neighbours, nothing verified."""
    return AdaptiveRoadmap(Voronoi(robot(), joints(), SAMPLES, seed, NEIGHBOURS))


def offline_plant(seed: int) -> OfflinePlant:
    """The arm with the motors that were identified on PyBullet."""
    motors = MotorParameters.identified(ROBOT)
    return OfflinePlant(model(), seed, Gains.named("default"), motors, 1.0 / RATE, speed_scale=SPEED, active=joints())


def explorer(plant: Plant, seed: int, store: MapStore | None = None) -> MapExplorer:
    """Who explores the map of a seed; the single query sees no table that moved, for none does."""
    ways = query(model(), joints(), robot().home, seed, EXTENSIONS)
    return MapExplorer(new_map(seed), plant, seed=seed, query=ways, store=store)
