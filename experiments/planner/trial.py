"""Who is tried, and in which worlds: with the table down, up, or set anew for every query."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from experiments.kit.arm_roadmap import NEIGHBOURS, Belief, make_roadmap, with_goals
from experiments.kit.rivals import PlannedOnce, Repaired, Rival
from experiments.learning.arm_poses import arm_clauses
from experiments.planner.following import Followed, Frozen, Queries, follow, promises, queries, through, zone
from experiments.planner.table import DOWN, UP, TablePlant
from mobee import Lattice
from mobee.learning.value_iteration import OutcomeModel

TESTS = ("down", "moving", "up")


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """The queries of a seed, and the states (S,) in which the raised table is."""

    space: Lattice
    wanted: Queries
    blocked: NDArray[np.bool_]
    seed: int

    @classmethod
    def of_seed(cls, plant: TablePlant, space: Lattice, count: int, seed: int) -> Trial:
        """That many queries; leaves the table down."""
        blocked = zone(plant, space, UP) & ~zone(plant, space, DOWN)
        return cls(space, queries(plant, space, count, seed), blocked, seed)

    def of_model(self, beliefs: OutcomeModel, test: str) -> dict[str, float]:
        """Plans made with a transition model, in one world."""
        followed = self._followed(Frozen(self.space, beliefs), test)
        promised, kept = promises(self.space, beliefs, self.wanted, followed.ways)
        return _means(followed) | {"promised": promised, "kept": kept, "through": through(followed.ways, self.blocked)}

    def in_all_worlds(self, rival: Rival) -> dict[str, dict[str, float]]:
        """Someone in one world after the other."""
        return {test: _means(self._followed(rival, test)) for test in TESTS}

    def _followed(self, rival: Rival, test: str) -> Followed:
        heights = {"down": (DOWN,), "up": (UP,), "moving": (DOWN, UP)}[test]
        tops = np.random.default_rng([self.seed, 743]).choice(heights, len(self.wanted)).tolist()
        return follow(self.space, rival, self.wanted, tops, self.seed)


def roadmaps(plant: TablePlant, space: Lattice) -> dict[str, Rival]:
    """The lattice as a roadmap, verified with the table down: planned once, repaired for a query, repaired for good."""
    plant.set_top(DOWN)
    belief = Belief(plant.inner.model, np.zeros(len(space.joints)), arm_clauses())
    roadmap = make_roadmap("lattice", belief, space, plant.inner.motors.seed)
    vertex_of = with_goals(roadmap, space, np.arange(len(space)))
    repaired = {name: Repaired(roadmap, vertex_of, NEIGHBOURS, name == "remembers") for name in ("repairs", "remembers")}
    return {"planned once": PlannedOnce(roadmap, vertex_of, NEIGHBOURS), **repaired}


def _means(followed: Followed) -> dict[str, float]:
    return {"success": followed.success, "actions": followed.actions, "touched": followed.touched, "met": followed.met}
