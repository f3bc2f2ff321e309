"""Queries past cups that the map knows nothing of."""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.control.ride import place
from experiments.pregrasp.settings import CUP, HEIGHT, PART, RADIUS, TOP, built
from experiments.trm.body import RIGHT_ARM, at_table
from mobee import (
    AdaptiveRoadmap,
    Gains,
    MobeeError,
    Model,
    MotorParameters,
    OfflinePlant,
    Roadmap,
    Space,
    Walker,
    World,
    cylinder,
    roadmap_space,
)
from mobee.plant import Outcome
from mobee.robot.robot import Array

MOST, DRAWS = 300, 300  # edges of a query; draws of one
NEAR = 0.05  # rad, within which a vertex is passed, the same whatever the density; the arm rests within as much of where it is sent
BESIDE = 0.01  # m: a cup stands that near to the optimistic way
FELT = 0.02  # m, deep in a field
DT = 0.02  # s
MODES = ("remove", "reweigh")
LOOK = 5  # ticks between two looks at whether the arm is there


class Passing:
    """An offline plant whose actions end as soon as every joint is within `near` of the target, so that vertices are passed."""

    def __init__(self, plant: OfflinePlant, near: float) -> None:
        self.robot, self._plant, self._near = plant.robot, plant, near

    def measure(self, part: str) -> Array:
        """See Plant."""
        return self._plant.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """See Plant."""
        plant, begun, settle = self._plant, self._plant.time, self._plant.controller.gains.settle
        plant.begin(part, target)
        while True:
            plant.run(LOOK)
            q, gone = plant.measure(part), plant.time - begun
            is_there = bool(np.abs(q - target)[: len(RIGHT_ARM)].max() <= self._near)
            rests = gone > settle.first_look and bool(np.abs(plant.controller.velocity).max() < settle.speed)
            if is_there or rests or gone > settle.timeout:
                return Outcome(q, rests, gone)


def queried(seed: int, spacing: float, queries: int) -> dict[str, Any]:
    """Success, bumps, edges and s of plant time of each mode and query; how many vertices and edges there are."""
    roadmap = built(spacing)
    space = roadmap_space(roadmap, RIGHT_ARM)
    drawn = [_drawn(np.random.default_rng([seed, query]), roadmap, space) for query in range(queries)]
    found: dict[str, Any] = {"vertices": len(space), "edges": space.state_actions}
    for mode in MODES:
        rows = [_walked(seed, AdaptiveRoadmap(space, mode, both_ways=True), *query) for query in drawn]
        for name, values in zip(("success", "bumps", "walked", "seconds"), zip(*rows, strict=True), strict=True):
            found[f"{mode}|{name}"] = np.array(values)
    return found


def _with_cup(where: Array) -> World:
    world = at_table().world
    world.add(CUP, cylinder(RADIUS, HEIGHT), position=(*where, TOP + 0.5 * HEIGHT))
    return world


def _drawn(rng: np.random.Generator, roadmap: Roadmap, space: Space) -> tuple[int, int, Array]:
    """A start, a goal, and a cup by which the optimistic way leads, with another way around it; raises MobeeError if none is found."""
    places = roadmap.model.evaluate(_whole(space, range(len(space)))).position("right_palm")[:, :2]
    for _ in range(DRAWS):
        ends = rng.uniform(places.min(axis=0), places.max(axis=0), (2, 2))
        start, goal = (int(np.linalg.norm(places - end, axis=1).argmin()) for end in ends)
        way = list(AdaptiveRoadmap(space).plan(start, goal))
        cup = places[way[int(rng.integers(len(way)))]] + rng.uniform(-BESIDE, BESIDE, 2)
        felt = _felt(Model(space.robot, _with_cup(cup)), space)
        if not felt[way].any() or felt[[start, goal]].any():
            continue
        truth = AdaptiveRoadmap(space)
        for state, action in np.argwhere((space.goals >= 0) & (felt[space.goals] | felt[:, None])).tolist():
            truth.observe(state, action, state)
        if truth.reachable(start)[goal]:
            return start, goal, cup
    raise MobeeError(f"no query past a cup in {DRAWS} draws: take another seed.")


def _felt(model: Model, space: Space) -> Any:
    """The vertices in which a cup is deep in a field, (S,) bool: what is felt lightly gives way enough."""
    poses = (model.evaluate(q) for q in _whole(space, range(len(space))))
    return np.array([any(CUP in (c.first, c.second) and c.depth > FELT for c in pose.contacts) for pose in poses])


def _whole(space: Space, vertices: Any) -> Array:
    q = np.repeat(space.robot.home[None], len(vertices), axis=0)
    q[:, space.robot.parts[PART].slice] = [space.target(vertex) for vertex in vertices]
    return q


def _walked(seed: int, roadmap: AdaptiveRoadmap, start: int, goal: int, cup: Array) -> tuple[bool, int, int, float]:
    space = roadmap.space
    plant = OfflinePlant(
        Model(space.robot, _with_cup(cup)), seed, Gains.default(), MotorParameters.identified("icub"), DT, active=RIGHT_ARM
    )
    place(plant, _whole(space, [start])[0])
    begun, walker, arrived = plant.time, Walker(roadmap, Passing(plant, NEAR), near=1.2 * NEAR), False
    try:
        arrived = walker.go(goal, MOST).arrived
    except MobeeError:
        pass  # no way is left, or it cannot come back to the map: the query failed
    bumps = round(float(roadmap.beliefs.failed.sum()) / 2.0)  # each is known of the way back, too
    return arrived, bumps, walker.record.transitions, plant.time - begun
