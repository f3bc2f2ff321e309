# SPDX-License-Identifier: Apache-2.0
"""Queries of the published arm among balls, the wrong models of its planners, and the execution of the queries."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.kit.control.plant_runs import place
from experiments.kit.learning.arm import ARM_NEIGHBOURS, JOINTS, PART, RANK3, arm_clauses, arm_plant, arm_space, columns, robot, whole
from experiments.kit.learning.arm_planners import Rival
from experiments.kit.learning.arm_roadmap import Belief
from mobee import Lattice, Model, OfflinePlant, World, sphere
from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue

BELIEFS = ("true", "no cables", "miscalibrated", "both", "gross")
BALLS, RADIUS = 4, 0.03  # m
SHIFT, TURN = 0.01, np.deg2rad(3.0)  # m and rad, errors of the believed position of a ball and of a joint angle
MAX_MOTIONS = 20_000  # among which the queries are found
QUERY_TIMEOUT = 120.0  # s of plant time per query


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """The true world, the errors of the planners' model, and Q queries, each from rest at `starts` to the cell of a lattice state."""

    balls: Array  # (B, 3) m
    shifts: Array  # (B, 3) m, believed minus true positions
    turns: Array  # (4,) rad, believed minus true joint angles
    starts: Array  # (Q, 4) rad
    goals: Ints  # (Q,)
    is_hard: NDArray[np.bool_]  # (Q,): the straight motion failed when it was tried


def space() -> Lattice:
    """Return the published lattice of rank 3 with 16 neighbours."""
    return arm_space(RANK3, ARM_NEIGHBOURS)


def world_of(balls: Array) -> World:
    """Return a world with balls at these positions (B, 3) m."""
    world = World()
    for number, position in enumerate(balls):
        world.add(f"ball {number}", sphere(RADIUS), position=position)
    return world


def plant_of(scene: Scene, seed: int, start: Array) -> OfflinePlant:
    """Return the true robot among the true balls, at rest at `start` (4,) rad."""
    plant = arm_plant(seed, world=world_of(scene.balls))
    place(plant, whole(start[None])[0])
    return plant


def make_scene(seed: int, queries: int) -> Scene:
    """Draw balls in the workspace, and queries; in half of them, or as many as are found, a straight motion does not reach the goal."""
    rng = np.random.default_rng([seed, 75])
    balls = _balls(rng)
    shifts = rng.normal(size=balls.shape)
    shifts *= SHIFT / np.linalg.norm(shifts, axis=1, keepdims=True)
    turns = TURN * rng.choice([-1.0, 1.0], size=JOINTS)
    return Scene(balls, shifts, turns, *_queries(seed, rng, balls, queries))


def _balls(rng: np.random.Generator) -> Array:
    """Return positions of the palm in random poses between the lattice's outer samples, where a ball does not touch the robot at home."""
    low, high = robot().limits[columns()].T
    alone = Model(robot())
    found: list[Array] = []
    while len(found) < BALLS:
        pose = low + rng.uniform(RANK3[0], RANK3[-1], JOINTS) * (high - low)
        ball = alone.evaluate(whole(pose)).position("left_palm")
        if not len(Model(robot(), world_of(ball[None])).evaluate(robot().home).table):
            found.append(ball)
    return np.array(found)


def _queries(seed: int, rng: np.random.Generator, balls: Array, count: int) -> tuple[Array, Ints, NDArray[np.bool_]]:
    """Move straight from sample to sample; choose queries among these motions, whose goals were reached at least once."""
    lattice = space()
    plant = arm_plant(seed, world=world_of(balls))
    free = [s for s in range(len(lattice)) if not len(plant.model.evaluate(whole(lattice.samples[s])).table)]
    tried: list[tuple[Array, int, bool]] = []
    reached: set[int] = set()
    here = plant.measure(PART)[:JOINTS]
    while len(tried) < MAX_MOTIONS:
        goal = int(rng.choice(free))
        end = plant.act(PART, lattice.target(goal)).q[:JOINTS]
        succeeded = lattice.state_of(end) == goal
        if lattice.state_of(here) != goal:
            tried.append((here, goal, not succeeded))
        reached |= {goal} if succeeded else set()
        here = end
        if len(tried) % 100 == 0:
            hard = [query for query in tried if query[2] and query[1] in reached]
            easy = [query for query in tried if not query[2]]
            if min(len(hard), len(easy)) >= (count + 1) // 2:
                break
    if not hard or not easy:
        raise InvalidValue(
            f"scene {seed}: straight motions reached {len(easy)} of {len(tried)} goals; queries of both kinds are needed: use another seed."
        )
    half = count // 2
    chosen = [*_some(rng, hard, count - half), *_some(rng, easy, half)]
    chosen = [chosen[i] for i in rng.permutation(len(chosen))]
    starts, goals, failed = zip(*chosen, strict=True)
    return np.array(starts), np.array(goals, dtype=np.intp), np.array(failed)


def _some(rng: np.random.Generator, queries: list[tuple[Array, int, bool]], count: int) -> list[tuple[Array, int, bool]]:
    return [queries[i] for i in rng.permutation(len(queries))[:count]]


def believed(scene: Scene, kind: str) -> Belief:
    """Return a planner's model of a scene, one of the BELIEFS.

    "true": without errors; "no cables": without the constraints of the shoulder's cables; "miscalibrated": balls wrong by 1 cm and joints
    by 3 degrees; "both": both errors; "gross": both, with three times the miscalibration.
    """
    times = {"miscalibrated": 1.0, "both": 1.0, "gross": 3.0}.get(kind, 0.0)
    clauses = [] if kind in ("no cables", "both", "gross") else arm_clauses()
    return Belief(Model(robot(), world_of(scene.balls + times * scene.shifts)), times * scene.turns, clauses)


@dataclass(frozen=True, slots=True, eq=False)
class Answers:
    """The results of Q queries."""

    success: NDArray[np.bool_]  # (Q,)
    seconds: Array  # (Q,) plant time, QUERY_TIMEOUT for queries that failed
    actions: Ints  # (Q,)
    repairs: Ints  # (Q,)


def answer(scene: Scene, rival: Rival, seed: int) -> Answers:
    """Send a rival to every goal, in order; the noise is the same for all rivals."""
    lattice = space()
    rows = []
    for number, goal in enumerate(scene.goals):
        plant = plant_of(scene, 1000 * seed + number, scene.starts[number])
        first_time, repairs, actions = plant.time, rival.repairs, 0
        rival.begin(int(goal))
        here = plant.measure(PART)[:JOINTS]
        while lattice.state_of(here) != goal and plant.time - first_time < QUERY_TIMEOUT:
            aim = rival.aim(here)
            if aim is None:
                break
            target = lattice.target(int(goal))
            target[:JOINTS] = aim
            end = plant.act(PART, target).q[:JOINTS]
            rival.observe(here, end)
            here, actions = end, actions + 1
        success, seconds = lattice.state_of(here) == goal, plant.time - first_time
        success = success and seconds <= QUERY_TIMEOUT
        rows.append((success, seconds if success else QUERY_TIMEOUT, actions, rival.repairs - repairs))
    success, seconds, actions, repairs = zip(*rows, strict=True)
    return Answers(np.array(success), np.array(seconds), np.array(actions), np.array(repairs))
