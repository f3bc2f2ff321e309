"""Exploration of a map of random poses, on the offline plant; arm, map and explorer are the same on the live robot."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from experiments.kit.control.plant_runs import place
from experiments.kit.control.safety import is_listed
from experiments.kit.live.launch import TABLE
from mobee import (
    AdaptiveRoadmap,
    Gains,
    MapExplorer,
    MobeeError,
    Model,
    MotorParameters,
    OfflinePlant,
    Plant,
    Voronoi,
    load_robot,
    load_world,
)
from mobee.arrays import Array
from mobee.roadmap.adaptive.record import MapStore
from mobee.roadmap.adaptive.walker import NEAR
from mobee.roadmap.ompl import query
from mobee.robot.robot import Robot

ROBOT, PART, MARKER = "icub", "right_arm", "right_palm"
JOINTS, SAMPLES, NEIGHBOURS = 7, 20, 10  # thesis 4.3.1: 20 and 10, of the whole upper body
RATE, SPEED = 50.0, 0.1  # Hz; share of the motors' speed, thesis 4.3.1
EXTENSIONS = 500  # of a single query
DEEP = 2e-3  # m, of a solid contact
SAMPLING = 5  # ticks, 0.1 s
JOB, DONE = "job.json", "done.json"


@cache
def robot() -> Robot:
    """The robot, offline and live."""
    return load_robot(ROBOT)


def model() -> Model:
    """The arm at its table."""
    return Model(robot(), load_world(str(TABLE)))


def joints() -> tuple[str, ...]:
    """Names of the joints of the map."""
    return robot().parts[PART].motors[:JOINTS]


def new_map(seed: int) -> AdaptiveRoadmap:
    """Random poses and their nearest neighbours, nothing verified."""
    return AdaptiveRoadmap(Voronoi(robot(), joints(), SAMPLES, seed, NEIGHBOURS))


def offline_plant(seed: int) -> OfflinePlant:
    """The arm with the motors that were identified on PyBullet."""
    motors = MotorParameters.identified(ROBOT)
    return OfflinePlant(model(), seed, Gains.named("default"), motors, 1.0 / RATE, speed_scale=SPEED, active=joints())


def explorer(plant: Plant, seed: int, store: MapStore | None = None) -> MapExplorer:
    """The explorer of the map of a seed; its single queries are made with the table at its place."""
    paths = query(model(), joints(), robot().home, seed, EXTENSIONS)
    return MapExplorer(new_map(seed), plant, seed=seed, query=paths, store=store)


class Depth:
    """The deepest contact of solids that are listed, by the model, in the true postures of a plant."""

    def __init__(self, plant: OfflinePlant) -> None:
        self._plant = plant
        self.deepest, self.pair = 0.0, ""
        plant.every(SAMPLING, self._update)

    def _update(self, time: float) -> None:
        for contact in self._plant.model.evaluate(self._plant.motors.q).contacts:
            if contact.kind == "solid" and contact.depth > self.deepest and is_listed(contact.first, contact.second):
                self.deepest, self.pair = float(contact.depth), f"{contact.first} {contact.second}"


def explored(seed: int, most: int | None = None) -> dict[str, Any]:
    """Explore the map of a seed, with at most so many edges; returns the map and measures of the exploration."""
    plant = offline_plant(seed)
    depth, search = Depth(plant), explorer(plant, seed)
    minutes: list[float] = []
    finished, why = False, ""
    try:
        while not finished and (most is None or len(minutes) < most):
            finished = search.explore(1)
            minutes.append(plant.time / 60.0)
    except MobeeError as error:
        why = str(error)
    found = outcome(search.roadmap, search.repairs)
    found |= {"finished": finished, "why": why, "minutes": np.array(minutes), "deepest": depth.deepest, "pair": depth.pair}
    return found | {"agree": agreement(search.roadmap, seed + 1000)}


def outcome(roadmap: AdaptiveRoadmap, repairs: int) -> dict[str, Any]:
    """The map as arrays, and what was observed of it."""
    beliefs, space = roadmap.beliefs, roadmap.space
    return {"samples": space.samples, "goals": space.goals, "tried": beliefs.tried, "feasible": roadmap.feasible, "repairs": repairs}


def agreement(roadmap: AdaptiveRoadmap, seed: int) -> Array:
    """Whether each edge that was tried has the same outcome when it is tried once more, from rest at its vertex, (E,)."""
    plant, space = offline_plant(seed), roadmap.space
    same = []
    for state, action in np.argwhere(roadmap.beliefs.tried > 0).tolist():
        whole = plant.robot.home.copy()
        whole[plant.robot.parts[PART].slice] = space.target(state)
        place(plant, whole)
        goal = space.goal(state, action)
        off = np.abs(plant.act(PART, space.target(goal)).q[space.columns] - space.samples[goal]).max()
        same.append((off <= NEAR) == roadmap.beliefs.last[state, action])
    return np.array(same, dtype=bool)
