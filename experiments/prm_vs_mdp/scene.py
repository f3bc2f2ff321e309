"""A robot among balls, what to reach in it, and by how much its planners are mistaken about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.kit.arm_learning import ARM_NEIGHBOURS, JOINTS, PART, RANK3, arm_plant, arm_space, columns, robot, whole
from experiments.kit.control_runs import place
from mobee import Lattice, Model, OfflinePlant, World, sphere
from mobee.errors import InvalidValue
from mobee.robot.robot import Array, Ints

BALLS, RADIUS = 4, 0.03  # m
SHIFT, TURN = 0.01, np.deg2rad(3.0)  # m by which a ball, rad by which a joint is not where it is believed
MOST_TRIES = 20_000  # of motions among which the queries are found


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """What is true, what is believed, and Q queries, each from rest at `starts` to the cell of a lattice state."""

    balls: Array  # (B, 3) m
    shifts: Array  # (B, 3) m, believed minus true places
    turns: Array  # (4,) rad, believed minus true joint angles
    starts: Array  # (Q, 4) rad
    goals: Ints  # (Q,)
    is_hard: NDArray[np.bool_]  # (Q,): going straight there failed when it was tried


def space() -> Lattice:
    """The published lattice of rank 3 with 16 neighbours."""
    return arm_space(RANK3, ARM_NEIGHBOURS)


def world_of(balls: Array) -> World:
    """Balls at these places (B, 3) m."""
    world = World()
    for number, position in enumerate(balls):
        world.add(f"ball {number}", sphere(RADIUS), position=position)
    return world


def plant_of(scene: Scene, seed: int, start: Array) -> OfflinePlant:
    """The true robot among the true balls, at rest at `start` (4,) rad."""
    plant = arm_plant(seed, world=world_of(scene.balls))
    place(plant, whole(start[None])[0])
    return plant


def make_scene(seed: int, queries: int) -> Scene:
    """Balls where the hand can come, and queries of which every other one is not reached by going straight, or as many as are found."""
    rng = np.random.default_rng([seed, 75])
    balls = _balls(rng)
    shifts = rng.normal(size=balls.shape)
    shifts *= SHIFT / np.linalg.norm(shifts, axis=1, keepdims=True)
    turns = TURN * rng.choice([-1.0, 1.0], size=JOINTS)
    return Scene(balls, shifts, turns, *_queries(seed, rng, balls, queries))


def _balls(rng: np.random.Generator) -> Array:
    """Places of the palm in random poses between the lattice's outer samples, that touch nothing of the robot at home."""
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
    """Wander straight from sample to sample; what was tried becomes a query, if its goal was ever reached."""
    lattice = space()
    plant = arm_plant(seed, world=world_of(balls))
    free = [s for s in range(len(lattice)) if not len(plant.model.evaluate(whole(lattice.samples[s])).table)]
    tried: list[tuple[Array, int, bool]] = []
    reached: set[int] = set()
    here = plant.measure(PART)[:JOINTS]
    while len(tried) < MOST_TRIES:
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
            f"scene {seed}: going straight reached {len(easy)} of {len(tried)} goals; leave this seed out, there is no choice."
        )
    half = count // 2
    chosen = [*_some(rng, hard, count - half), *_some(rng, easy, half)]
    chosen = [chosen[i] for i in rng.permutation(len(chosen))]
    starts, goals, failed = zip(*chosen, strict=True)
    return np.array(starts), np.array(goals, dtype=np.intp), np.array(failed)


def _some(rng: np.random.Generator, queries: list[tuple[Array, int, bool]], count: int) -> list[tuple[Array, int, bool]]:
    return [queries[i] for i in rng.permutation(len(queries))[:count]]
