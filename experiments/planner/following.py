"""Plans of a learned model carried out, and how they compare with what the model promised."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from experiments.control.ride import place
from experiments.kit.rivals import Rival
from experiments.learning.arm_poses import JOINTS, PART, arm_clauses, clear, whole
from experiments.planner.table import DOWN, UP, TablePlant
from mobee import Lattice
from mobee.errors import MobeeError
from mobee.learning.planner import Plan, Planner
from mobee.learning.value_iteration import OutcomeModel
from mobee.robot.robot import Array

Queries = list[tuple[int, int]]  # states, start and goal
LIMIT = 20  # actions
WAY = np.linspace(0.0, 1.0, 41)  # where the straight way between two samples is looked at


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """Means over the queries."""

    success: float
    """Share that arrived within LIMIT actions."""
    actions: float
    """A query, LIMIT where it did not arrive."""
    touched: float
    """Share of actions that ended in the table's field."""
    met: float
    """Share of queries in which one did: who is stuck at the table counts once."""
    ways: tuple[tuple[int, ...], ...]
    """The states of each query, from start to end."""


class Frozen:
    """Plans by a transition model anew after each action, and learns nothing on the way."""

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


def zone(plant: TablePlant, space: Lattice, top: float) -> NDArray[np.bool_]:
    """Which states' samples (S,) are not clear of contacts and cables with the table at that height."""
    plant.set_top(top)
    return ~clear(plant.inner.model, space.samples, arm_clauses())


def queries(plant: TablePlant, space: Lattice, count: int, seed: int) -> Queries:
    """Pairs of states, start and goal, between which the raised table is in the straight way, and nothing else; it is in neither."""
    free = np.flatnonzero(~zone(plant, space, UP))
    pairs = list(permutations(free.tolist(), 2))
    rng = np.random.default_rng([seed, 742])
    chosen: list[tuple[int, int]] = []
    for start, goal in (pairs[i] for i in rng.permutation(len(pairs))):
        way = space.samples[start] + WAY[:, None] * (space.samples[goal] - space.samples[start])
        plant.set_top(UP)
        in_the_way = not clear(plant.inner.model, way, ()).all()
        plant.set_top(DOWN)
        if in_the_way and clear(plant.inner.model, way, arm_clauses()).all():
            chosen.append((start, goal))
            if len(chosen) == count:
                break
    return chosen


def follow(space: Lattice, rival: Rival, wanted: Queries, tops: Sequence[float], seed: int) -> Followed:
    """Send someone from rest at one state's sample to another state, each time with the table's top at its height [m]."""
    plant = TablePlant(seed + 900)
    touched = met = 0
    ways: list[tuple[int, ...]] = []
    for (start, goal), top in zip(wanted, tops, strict=True):
        plant.set_top(top)
        place(plant.inner, whole(space.samples[start]))
        rival.begin(goal)
        here = plant.measure(PART)[:JOINTS]
        states, before = [space.state_of(here)], touched
        while states[-1] != goal and len(states) <= LIMIT and (aim := rival.aim(here)) is not None:
            target = space.target(goal)
            target[:JOINTS] = aim
            outcome = plant.act(PART, target)
            rival.observe(here, outcome.q[:JOINTS])
            here = outcome.q[:JOINTS]
            states.append(space.state_of(here))
            touched += "table" in outcome.touched
        ways.append(tuple(states))
        met += touched > before
    arrived = np.array([way[-1] == goal for way, (_, goal) in zip(ways, wanted, strict=True)])
    needed = np.array([len(way) - 1 for way in ways])
    mean = float(np.where(arrived, needed, LIMIT).mean())
    return Followed(float(arrived.mean()), mean, touched / max(int(needed.sum()), 1), met / len(ways), tuple(ways))


def promises(space: Lattice, beliefs: OutcomeModel, wanted: Queries, ways: Sequence[tuple[int, ...]]) -> tuple[float, float]:
    """How likely a plan is believed to go as it says, and how often it did, means over the queries; 0 without a plan."""
    plans = [_plan(space, beliefs, start, goal) for start, goal in wanted]
    kept = [plan is not None and plan.path == way for plan, way in zip(plans, ways, strict=True)]
    return float(np.mean([plan.success if plan else 0.0 for plan in plans])), float(np.mean(kept))


def _plan(space: Lattice, beliefs: OutcomeModel, start: int, goal: int) -> Plan | None:
    """None where no way is known."""
    try:
        return Planner(space, beliefs, [goal]).plan(start)
    except MobeeError:
        return None


def through(ways: Sequence[tuple[int, ...]], blocked: NDArray[np.bool_]) -> float:
    """Share of the states on the ways, those between start and end, in which the raised table is."""
    passed = [bool(blocked[state]) for way in ways for state in way[1:-1]]
    return float(np.mean(passed)) if passed else 0.0
