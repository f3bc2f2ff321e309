"""Plans of a learned model carried out, and how they compare with what the model promised."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from experiments.control.ride import place
from experiments.learning.arm_poses import JOINTS, PART, arm_clauses, silent, whole
from experiments.planner.table import DOWN, UP, TablePlant
from mobee import Lattice
from mobee.learning.planner import Planner
from mobee.learning.value_iteration import OutcomeModel

LIMIT = 20  # actions
WAY = np.linspace(0.0, 1.0, 41)  # where the straight way between two samples is looked at


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """Means over the queries."""

    success: float
    """Share that arrived within LIMIT actions, planned anew after each."""
    actions: float
    """A query, LIMIT where it did not arrive."""
    promised: float
    """Probability that every action of the plan would end as it says."""
    kept: float
    """Share in which every one did."""
    touched: float
    """Share of actions that ended in the table's field."""
    through: float
    """Share of the states on the way, those between start and goal, in which the raised table is."""


def zone(plant: TablePlant, space: Lattice, top: float) -> NDArray[np.bool_]:
    """In which states' samples (S,) some force acts with the table at that height: contacts, or the cables."""
    plant.set_top(top)
    return ~silent(plant.inner.model, space.samples, arm_clauses())


def queries(plant: TablePlant, space: Lattice, count: int, seed: int) -> list[tuple[int, int]]:
    """Pairs of states, start and goal, between which the raised table is in the straight way, and nothing else; it is in neither."""
    free = np.flatnonzero(~zone(plant, space, UP))
    pairs = list(permutations(free.tolist(), 2))
    rng = np.random.default_rng([seed, 742])
    chosen: list[tuple[int, int]] = []
    for start, goal in (pairs[i] for i in rng.permutation(len(pairs))):
        way = space.samples[start] + WAY[:, None] * (space.samples[goal] - space.samples[start])
        plant.set_top(UP)
        in_the_way = not silent(plant.inner.model, way, ()).all()
        plant.set_top(DOWN)
        if in_the_way and silent(plant.inner.model, way, arm_clauses()).all():
            chosen.append((start, goal))
            if len(chosen) == count:
                break
    return chosen


def follow(
    space: Lattice, beliefs: OutcomeModel, wanted: list[tuple[int, int]], tops: list[float], blocked: NDArray[np.bool_], seed: int
) -> Followed:
    """Carry out plans from rest at one state's sample to another state, each with the table's top at its height [m]."""
    plant = TablePlant(seed + 900)
    rows = []
    touched = actions = 0
    passed: list[bool] = []
    for (start, goal), top in zip(wanted, tops, strict=True):
        plant.set_top(top)
        place(plant.inner, whole(space.samples[start]))
        planner = Planner(space, beliefs, [goal])
        plan = planner.plan(start)
        states = [space.state_of(plant.measure(PART)[:JOINTS])]
        while states[-1] != goal and len(states) <= LIMIT:
            target = space.target(space.goal(states[-1], int(planner.policy[states[-1]])))
            outcome = plant.act(PART, target)
            states.append(space.state_of(outcome.q[:JOINTS]))
            touched += "table" in outcome.touched
        actions += len(states) - 1
        passed += [bool(blocked[state]) for state in states[1:-1]]
        success = states[-1] == goal
        rows.append((success, len(states) - 1 if success else LIMIT, plan.success, tuple(states) == plan.path))
    success, needed, promised, kept = np.array(rows, dtype=np.float64).mean(axis=0).tolist()
    return Followed(success, needed, promised, kept, touched / max(actions, 1), float(np.mean(passed)) if passed else 0.0)
