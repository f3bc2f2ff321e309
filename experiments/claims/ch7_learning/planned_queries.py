# SPDX-License-Identifier: Apache-2.0
"""Queries (pairs of a start and a goal state) for an arm beside a table that moves up and down, and the execution of plans for them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from experiments.kit.control.plant_runs import place
from experiments.kit.learning.arm import JOINTS, PART, arm_clauses, arm_plant, clear, whole
from experiments.kit.learning.arm_planners import NEIGHBOURS, Belief, PlannedOnce, Repaired, Rival, make_roadmap, with_goals
from experiments.kit.plants import WrappedPlant
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
    """An offline plant of the left arm with a table whose top can be moved up and down.

    `moves`: before every tenth action, the top is set at random to the lower or the upper height.
    """

    def __init__(self, seed: int, moves: bool = False) -> None:
        self.world = World()
        self.world.add("table", box(*SIZE), position=_middle(DOWN))
        super().__init__(arm_plant(seed, world=self.world))
        self._moves, self._rng, self._actions = moves, np.random.default_rng([seed, 741]), 0

    def set_top(self, height: float) -> None:
        """Move the top of the table to this height [m] in the root frame."""
        self.world.move("table", position=_middle(height))

    def act(self, part: str, target: Array) -> Outcome:
        """Perform an action as `mobee.plant.Plant.act` does; a table that moves is moved before every tenth action.

        `part`, `target`: as in that method.
        """
        if self._moves and self._actions % PERIOD == 0:
            self.set_top(self._rng.choice((DOWN, UP)))
        self._actions += 1
        return super().act(part, target)


def _middle(top: float) -> tuple[float, float, float]:
    return (*PLACE, top - SIZE[2] / 2.0)


class FrozenModel:
    """A planner that computes the best action of every state for the goal of a query, with a fixed transition model, and does not learn.

    It implements the protocol experiments.kit.learning.arm_planners.Rival.
    """

    repairs = 0

    def __init__(self, space: Lattice, beliefs: OutcomeModel) -> None:
        self._space, self._beliefs = space, beliefs

    def begin(self, goal: int) -> None:
        """Make a plan to the state `goal`; as in `experiments.kit.learning.arm_planners.Rival.begin`."""
        self.planner = Planner(self._space, self._beliefs, [goal])

    def aim(self, q: Array) -> Array | None:
        """Return the pose (4,) rad to which the arm moves next from the pose `q` (4,) rad; it is never None.

        It is the sample (the pose that represents a state) of the goal state of the planned action, which starts in the state of `q`.  As
        in `experiments.kit.learning.arm_planners.Rival.aim`.
        """
        state = self._space.state_of(q)
        sample: Array = self._space.samples[self._space.goal(state, int(self.planner.policy[state]))]
        return sample

    def observe(self, start: Array, end: Array) -> None:
        """Do nothing, because the model learns nothing from a motion.

        `start`, `end`: as in `experiments.kit.learning.arm_planners.Rival.observe`.
        """


def roadmaps(plant: TablePlant, space: Lattice) -> dict[str, Rival]:
    """Return three planners, by name, that use the lattice as a roadmap.

    The roadmap has the states and motions that are free of contacts with the table at its lower height.  "planned once" plans one path for
    each query.  "repairs" removes a motion that failed from the roadmap, only for the present query, and plans again; "remembers" does this
    for all later queries too.
    """
    plant.set_top(DOWN)
    belief = Belief(plant.inner.model, np.zeros(len(space.joints)), arm_clauses())
    roadmap = make_roadmap("lattice", belief, space, plant.inner.motors.seed)
    vertex_of = with_goals(roadmap, space, np.arange(len(space)))
    repaired = {name: Repaired(roadmap, vertex_of, NEIGHBOURS, name == "remembers") for name in ("repairs", "remembers")}
    return {"planned once": PlannedOnce(roadmap, vertex_of, NEIGHBOURS), **repaired}


@dataclass(frozen=True, slots=True, eq=False)
class Queries:
    """The queries of a seed: `pairs` of a start state and a goal state of the lattice `space`.

    `blocked` (S,): whether the arm touches the raised table when it is in the sample of a state (the pose that stands for this state).  A
    contact of the fields, larger volumes that cause repulsive forces, is enough.  False also if the arm touches something, or is near a
    cable constraint, with the lower table.
    """

    space: Lattice
    pairs: list[tuple[int, int]]
    blocked: NDArray[np.bool_]
    seed: int

    @classmethod
    def of_seed(cls, plant: TablePlant, space: Lattice, count: int, seed: int) -> Queries:
        """Draw `count` queries on a lattice; afterwards the table is at its lower height.

        `seed`: of the draw.
        """
        blocked = touched_states(plant, space, UP) & ~touched_states(plant, space, DOWN)
        return cls(space, drawn_pairs(plant, space, count, seed), blocked, seed)

    def of_model(self, beliefs: OutcomeModel, test: str) -> dict[str, float]:
        """Follow plans made with a transition model through all queries, and return the measures by name.

        `beliefs`: outcomes and probabilities of the actions.  `test`: position of the table, "down", "up" or "moving" (drawn for every
        query).  The measures are "success", "actions", "touched" and "met" as in `Followed`; "promised", the predicted probability that all
        actions of a plan end as planned; "kept", the share of queries that passed exactly the planned states; and "through", the share of
        states on the paths in which the arm would touch the raised table.
        """
        followed = self._followed(FrozenModel(self.space, beliefs), test)
        promised, kept = promises(self.space, beliefs, self.pairs, followed.paths)
        return followed.numbers() | {"promised": promised, "kept": kept, "through": through(followed.paths, self.blocked)}

    def in_all_worlds(self, rival: Rival) -> dict[str, dict[str, float]]:
        """Let the planner `rival` lead the arm through all queries, once for each position of the table; return the measures.

        They are a dict from the position, "down", "up" or "moving" (drawn for every query), to a dict from the name of a measure to its
        value: "success", share of queries that reached their goal state; "actions", number per query; "touched", share of actions that
        ended in contact with the table; "met", share of queries with such an action.  `Followed` defines them.
        """
        return {test: self._followed(rival, test).numbers() for test in TESTS}

    def _followed(self, rival: Rival, test: str) -> Followed:
        heights = {"down": (DOWN,), "up": (UP,), "moving": (DOWN, UP)}[test]
        tops = np.random.default_rng([self.seed, 743]).choice(heights, len(self.pairs)).tolist()
        return follow(self.space, rival, self.pairs, tops, self.seed)


def touched_states(plant: TablePlant, space: Lattice, top: float) -> NDArray[np.bool_]:
    """Return in which states (S,) the arm has a contact or is too near to a cable constraint, when it is in the sample of the state.

    `top`: height of the table's top [m], to which the table is moved before; it stays there.
    """
    plant.set_top(top)
    return ~clear(plant.inner.model, space.samples, arm_clauses())


def drawn_pairs(plant: TablePlant, space: Lattice, count: int, seed: int) -> list[tuple[int, int]]:
    """Draw up to `count` pairs of states whose straight path in joint space is blocked by the raised table, and by nothing else.

    In the samples of both states (the poses that stand for them) the arm touches nothing, even if the table is raised.  Afterwards the
    table is at its lower height.  `seed`: of the draw.
    """
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
    """How well a planner led the arm through the queries: `success`, `actions`, `touched` and `met` (see the fields), and the paths.

    `paths`: the visited states of each query, from its start to its end.
    """

    success: float
    """Share of queries that reached their goal state within 20 actions."""
    actions: float
    """Actions per query; a query that failed counts as 20."""
    touched: float
    """Share of actions that ended in contact with the table (fields included)."""
    met: float
    """Share of queries with at least one action that ended in contact with the table (fields included)."""
    paths: Paths

    def numbers(self) -> dict[str, float]:
        """Return a dict with the values of `success`, `actions`, `touched` and `met`."""
        return {"success": self.success, "actions": self.actions, "touched": self.touched, "met": self.met}


def follow(space: Lattice, rival: Rival, pairs: Sequence[tuple[int, int]], tops: Sequence[float], seed: int) -> Followed:
    """Let a planner lead the arm from the sample of a start state to a goal state in each query, and return the measures.

    `pairs`: start state and goal state of each query.  `tops`: height of the table's top in each query [m].  `seed`: of the plant's noise.
    The arm begins at rest.  A query ends at its goal state, after 20 actions (MAX_ACTIONS), or when the planner gives up.
    """
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
    """Return the predicted and the observed reliability of plans: two numbers from 0 to 1, means over the queries.

    The first is the predicted probability that all actions of a plan end as planned.  The second is the share of queries whose states, in
    `paths`, were exactly those of the plan.  `beliefs`: transition model of the plans.  `pairs`: start and goal state of each query.  A
    query without a plan counts as 0 in both.
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
    """Return the share of states on the paths, without start and end, in which the arm would touch the raised table.

    `paths`: states of each query.  `blocked`: (S,), the states of `Queries.blocked`.  0 if there are no states between start and end.
    """
    passed = [bool(blocked[state]) for path in paths for state in path[1:-1]]
    return float(np.mean(passed)) if passed else 0.0
