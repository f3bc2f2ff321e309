# SPDX-License-Identifier: Apache-2.0
"""Queries of an arm around a table that moves up and down, and the execution of plans for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from experiments.kit.control.plant_runs import place
from experiments.kit.learning.arm import JOINTS, PART, arm_clauses, arm_plant, clear, whole
from experiments.kit.learning.arm_planners import NEIGHBOURS, Belief, PlannedOnce, Repaired, Rival, make_roadmap, with_goals
from experiments.kit.wrapped_plant import WrappedPlant
from mobee import Lattice, OfflinePlant, Outcome, World, box
from mobee.arrays import Array
from mobee.errors import MobeeError
from mobee.learning.planner import Plan, Planner
from mobee.learning.value_iteration import OutcomeModel

Paths = Sequence[tuple[int, ...]]  # the states of each query, from start to end

SIZE, PLACE = (0.3, 0.4, 0.12), (-0.45, -0.45)  # m: edges; x and y of the table's middle
DOWN, UP = -0.5, 0.31  # m, height of its top: out of reach, and at the height of the chest, where it blocks many paths of the arm
PERIOD = 10  # actions after which a moving table is moved
TESTS = ("down", "moving", "up")  # position of the table while plans are executed; "moving": drawn for every query
MAX_ACTIONS = 20  # actions of a query
ALONG = np.linspace(0.0, 1.0, 41)  # shares of the straight path between two samples at which it is checked


class TablePlant(WrappedPlant[OfflinePlant]):
    """A Plant of the arm with the table; `moves`: the table is moved up or down at random after every PERIOD actions."""

    def __init__(self, seed: int, moves: bool = False) -> None:
        self.world = World()
        self.world.add("table", box(*SIZE), position=_middle(DOWN))
        super().__init__(arm_plant(seed, world=self.world))
        self._moves, self._rng, self._actions = moves, np.random.default_rng([seed, 741]), 0

    def set_top(self, height: float) -> None:
        """Move the table's top to a height [m]."""
        self.world.move("table", position=_middle(height))

    def act(self, part: str, target: Array) -> Outcome:
        """See Plant."""
        if self._moves and self._actions % PERIOD == 0:
            self.set_top(self._rng.choice((DOWN, UP)))
        self._actions += 1
        return super().act(part, target)


def _middle(top: float) -> tuple[float, float, float]:
    return (*PLACE, top - SIZE[2] / 2.0)


class FrozenModel:
    """A Rival that replans with a transition model after each action, and does not learn."""

    repairs = 0

    def __init__(self, space: Lattice, beliefs: OutcomeModel) -> None:
        self._space, self._beliefs = space, beliefs

    def begin(self, goal: int) -> None:
        """See Rival."""
        self.planner = Planner(self._space, self._beliefs, [goal])

    def aim(self, q: Array) -> Array | None:
        """See Rival."""
        state = self._space.state_of(q)
        sample: Array = self._space.samples[self._space.goal(state, int(self.planner.policy[state]))]
        return sample

    def observe(self, start: Array, end: Array) -> None:
        """See Rival."""


def roadmaps(plant: TablePlant, space: Lattice) -> dict[str, Rival]:
    """Return the lattice as a roadmap, verified with the table down: planned once, or repaired for one query or permanently."""
    plant.set_top(DOWN)
    belief = Belief(plant.inner.model, np.zeros(len(space.joints)), arm_clauses())
    roadmap = make_roadmap("lattice", belief, space, plant.inner.motors.seed)
    vertex_of = with_goals(roadmap, space, np.arange(len(space)))
    repaired = {name: Repaired(roadmap, vertex_of, NEIGHBOURS, name == "remembers") for name in ("repairs", "remembers")}
    return {"planned once": PlannedOnce(roadmap, vertex_of, NEIGHBOURS), **repaired}


@dataclass(frozen=True, slots=True, eq=False)
class Queries:
    """The queries of a seed: pairs of states, start and goal; `blocked` (S,): the states whose samples touch the raised table."""

    space: Lattice
    pairs: list[tuple[int, int]]
    blocked: NDArray[np.bool_]
    seed: int

    @classmethod
    def of_seed(cls, plant: TablePlant, space: Lattice, count: int, seed: int) -> Queries:
        """Draw queries; leaves the table down."""
        blocked = touched_states(plant, space, UP) & ~touched_states(plant, space, DOWN)
        return cls(space, drawn_pairs(plant, space, count, seed), blocked, seed)

    def of_model(self, beliefs: OutcomeModel, test: str) -> dict[str, float]:
        """Return the measures of plans made with a transition model, in one of the TESTS."""
        followed = self._followed(FrozenModel(self.space, beliefs), test)
        promised, kept = promises(self.space, beliefs, self.pairs, followed.paths)
        return followed.numbers() | {"promised": promised, "kept": kept, "through": through(followed.paths, self.blocked)}

    def in_all_worlds(self, rival: Rival) -> dict[str, dict[str, float]]:
        """Return the measures of a rival in each of the TESTS."""
        return {test: self._followed(rival, test).numbers() for test in TESTS}

    def _followed(self, rival: Rival, test: str) -> Followed:
        heights = {"down": (DOWN,), "up": (UP,), "moving": (DOWN, UP)}[test]
        tops = np.random.default_rng([self.seed, 743]).choice(heights, len(self.pairs)).tolist()
        return follow(self.space, rival, self.pairs, tops, self.seed)


def touched_states(plant: TablePlant, space: Lattice, top: float) -> NDArray[np.bool_]:
    """Return which states' samples (S,) are not clear of contacts and cables with the table's top at a height [m]."""
    plant.set_top(top)
    return ~clear(plant.inner.model, space.samples, arm_clauses())


def drawn_pairs(plant: TablePlant, space: Lattice, count: int, seed: int) -> list[tuple[int, int]]:
    """Draw pairs of states whose straight path is blocked by the raised table and by nothing else; the table is in neither state."""
    free = np.flatnonzero(~touched_states(plant, space, UP))
    every = list(permutations(free.tolist(), 2))
    rng = np.random.default_rng([seed, 742])
    chosen: list[tuple[int, int]] = []
    for start, goal in (every[i] for i in rng.permutation(len(every))):
        path = space.samples[start] + ALONG[:, None] * (space.samples[goal] - space.samples[start])
        plant.set_top(UP)
        is_blocked = not clear(plant.inner.model, path, ()).all()
        plant.set_top(DOWN)
        if is_blocked and clear(plant.inner.model, path, arm_clauses()).all():
            chosen.append((start, goal))
            if len(chosen) == count:
                break
    return chosen


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """How well plans or paths lead to their goals: means over the queries."""

    success: float
    """Share of queries that reached their goal within MAX_ACTIONS actions."""
    actions: float
    """Actions per query, MAX_ACTIONS for queries that failed."""
    touched: float
    """Share of actions that ended in the table's field."""
    met: float
    """Share of queries with at least one such action: a query that is stuck at the table counts once."""
    paths: Paths

    def numbers(self) -> dict[str, float]:
        """Return all fields but the paths, by name."""
        return {"success": self.success, "actions": self.actions, "touched": self.touched, "met": self.met}


def follow(space: Lattice, rival: Rival, pairs: Sequence[tuple[int, int]], tops: Sequence[float], seed: int) -> Followed:
    """Send a rival from rest at one state's sample to another state, for each query with the table's top at the given height [m]."""
    plant = TablePlant(seed + 900)
    touched = met = 0
    paths: list[tuple[int, ...]] = []
    for (start, goal), top in zip(pairs, tops, strict=True):
        plant.set_top(top)
        place(plant.inner, whole(space.samples[start]))
        rival.begin(goal)
        here = plant.measure(PART)[:JOINTS]
        states, before = [space.state_of(here)], touched
        while states[-1] != goal and len(states) <= MAX_ACTIONS and (aim := rival.aim(here)) is not None:
            target = space.target(goal)
            target[:JOINTS] = aim
            outcome = plant.act(PART, target)
            rival.observe(here, outcome.q[:JOINTS])
            here = outcome.q[:JOINTS]
            states.append(space.state_of(here))
            touched += "table" in outcome.touched
        paths.append(tuple(states))
        met += touched > before
    arrived = np.array([path[-1] == goal for path, (_, goal) in zip(paths, pairs, strict=True)])
    needed = np.array([len(path) - 1 for path in paths])
    mean = float(np.where(arrived, needed, MAX_ACTIONS).mean())
    return Followed(float(arrived.mean()), mean, touched / max(int(needed.sum()), 1), met / len(paths), tuple(paths))


def promises(space: Lattice, beliefs: OutcomeModel, pairs: Sequence[tuple[int, int]], paths: Paths) -> tuple[float, float]:
    """Return two numbers of the paths: the predicted probability that a plan is followed exactly, and the share that was followed so.

    Both are 0 if no plan was found.
    """
    plans = [_plan(space, beliefs, start, goal) for start, goal in pairs]
    kept = [plan is not None and plan.path == path for plan, path in zip(plans, paths, strict=True)]
    return float(np.mean([plan.success if plan else 0.0 for plan in plans])), float(np.mean(kept))


def _plan(space: Lattice, beliefs: OutcomeModel, start: int, goal: int) -> Plan | None:
    """Return the plan from a state to the goal state, or None if the beliefs contain no path."""
    try:
        return Planner(space, beliefs, [goal]).plan(start)
    except MobeeError:
        return None


def through(paths: Paths, blocked: NDArray[np.bool_]) -> float:
    """Return the share of the states on the paths, without start and end, that the raised table blocks."""
    passed = [bool(blocked[state]) for path in paths for state in path[1:-1]]
    return float(np.mean(passed)) if passed else 0.0
