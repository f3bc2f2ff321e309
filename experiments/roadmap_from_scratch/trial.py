"""One map, explored on the offline plant."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.kit.control_runs import place
from experiments.kit.safety_measures import is_listed
from experiments.roadmap_from_scratch.settings import PART, explorer, offline_plant
from mobee import AdaptiveRoadmap, MobeeError, OfflinePlant
from mobee.roadmap.adaptive.walker import NEAR
from mobee.robot.robot import Array

LOOK = 5  # ticks, 0.1 s


class Depth:
    """The deepest contact of solids that are listed, by the model, in the true postures of a plant."""

    def __init__(self, plant: OfflinePlant) -> None:
        self._plant = plant
        self.deepest, self.pair = 0.0, ""
        plant.every(LOOK, self._look)

    def _look(self, time: float) -> None:
        for contact in self._plant.model.evaluate(self._plant.motors.q).contacts:
            if contact.kind == "solid" and contact.depth > self.deepest and is_listed(contact.first, contact.second):
                self.deepest, self.pair = float(contact.depth), f"{contact.first} {contact.second}"


def explored(seed: int, most: int | None = None) -> dict[str, Any]:
    """Explore the map of a seed, with at most so many edges; what came of it."""
    plant = offline_plant(seed)
    depth, who = Depth(plant), explorer(plant, seed)
    minutes, finished, why = [], False, ""
    try:
        while not finished and (most is None or len(minutes) < most):
            finished = who.explore(1)
            minutes.append(plant.time / 60.0)
    except MobeeError as error:
        why = str(error)
    found = outcome(who.roadmap, who.repairs)
    found |= {"finished": finished, "why": why, "minutes": np.array(minutes), "deepest": depth.deepest, "pair": depth.pair}
    return found | {"agree": agreement(who.roadmap, seed + 1000)}


def outcome(roadmap: AdaptiveRoadmap, repairs: int) -> dict[str, Any]:
    """The map as arrays, and what is known of it."""
    beliefs, space = roadmap.beliefs, roadmap.space
    return {"samples": space.samples, "goals": space.goals, "tried": beliefs.tried, "feasible": roadmap.feasible, "repairs": repairs}


def agreement(roadmap: AdaptiveRoadmap, seed: int) -> Array:
    """Of every edge that was tried, whether it works when it is tried from rest at its vertex as it did last, (E,)."""
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
