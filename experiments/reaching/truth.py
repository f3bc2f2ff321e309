"""What is true of reaching for a target: what a reach from each state brings, and which transitions the target blocks.

By many tries of each on the offline plant, begun as a learner begins them: where the part came to rest after the action before.  A
state from which something is still to be tried is reached with the target in place if a try ends there, else without it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.reaching.scene import MARKER, laws, reach_plant, reach_space
from mobee import OfflinePlant, Space
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.reaching.acting import move, reach
from mobee.reach import ReachTarget
from mobee.robot.robot import Array, Ints

TRIES = 5  # of everything
SEED = 9001  # no learner has it
CARRIES = 3  # attempts to come to a state
BLOCKED = 0.5  # share of tries that do not end in their goal, from which a transition counts as blocked


@dataclass(frozen=True, slots=True, eq=False)
class Tried:
    """What was measured of one target.

    `missing`: (S, n) m, of the tries of each state's reach.  `made`, `failed`: (S, A) tries of each transition, and how many did not end
    in its goal.
    """

    missing: Array
    made: Ints
    failed: Ints

    def values(self) -> dict[str, Any]:
        """As the values of a cell."""
        return {"missing": self.missing, "made": self.made, "failed": self.failed}


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """What is true of several targets.

    `places`: (T, 3) m.  `missing`: (T, S, n) m, NaN where a state was not come to.  `blocked`: (T, S, A) share of failures, NaN where
    nothing was tried.
    """

    places: Array
    missing: Array
    blocked: Array

    def rewards(self, scale: float) -> Array:
        """The mean reward of reaching from each state, shape (T, S) (thesis eq. 8.4); 0 where no state was come to."""
        found = 1.0 / (1.0 + self.missing / scale)
        tried = np.isfinite(found)
        mean: Array = np.where(tried, found, 0.0).sum(axis=-1) / np.maximum(tried.sum(axis=-1), 1)
        return mean

    def save(self, path: Path) -> None:
        """Write it as .npz."""
        np.savez_compressed(path, places=self.places, missing=self.missing, blocked=self.blocked)


def load_truth(path: Path) -> Truth:
    """The truth in a file."""
    with np.load(path) as file:
        return Truth(file["places"], file["missing"], file["blocked"])


def truth_of(measured: Mapping[tuple[float, ...], Mapping[str, Any]]) -> Truth:
    """The targets that were measured, by place."""
    each = list(measured.values())
    made = np.array([one["made"] for one in each])
    with np.errstate(invalid="ignore"):
        blocked = np.array([one["failed"] for one in each]) / made
    return Truth(np.array(list(measured)), np.array([one["missing"] for one in each]), blocked)


def measure(place: Array, law: str = "published", tries: int = TRIES, seed: int = SEED) -> Tried:
    """Try every reach and every transition that often while the target is at a place (3,) m."""
    target = ReachTarget(place, aim=laws()[law].aim)
    return _Measuring(reach_space(), reach_plant(seed, law), target, tries, seed).run()


class _Measuring:
    """The tries that are left, and where the part is."""

    def __init__(self, space: Space, plant: OfflinePlant, target: ReachTarget, tries: int, seed: int) -> None:
        self.space, self.plant, self.target = space, plant, target
        self.rng = np.random.default_rng(seed)
        shape = space.goals.shape
        self.left = np.zeros((shape[0], shape[1] + 1), dtype=np.intp)  # the last column: reaches
        self.left[:, :-1], self.left[:, -1] = tries * (space.goals != NO_ACTION), tries
        self.missing = np.full((shape[0], tries), np.nan)
        self.made, self.failed = np.zeros(shape, dtype=np.intp), np.zeros(shape, dtype=np.intp)

    def run(self) -> Tried:
        self.plant.present(None)
        state = self._at(int(self.rng.integers(len(self.space))))
        while self.left.any():
            if not self.left[state].any():
                state = self._carry()
            self.plant.present(self.target)
            while self.left[state].any():
                state = self._try(state)
        return Tried(self.missing, self.made, self.failed)

    def _carry(self) -> int:
        """Go without the target to a state from which something is left to try; one that cannot be come to is given up."""
        self.plant.present(None)
        goal = int(self.rng.choice(np.flatnonzero(self.left.any(axis=1))))
        for _ in range(CARRIES):
            state = self._at(goal)
            if self.left[state].any():
                return state
        self.left[goal] = 0
        return state

    def _at(self, goal: int) -> int:
        """Go to a state from wherever the part is; returns the state it comes to."""
        outcome = self.plant.act(self.space.part, self.space.target(goal))
        return self.space.state_of(outcome.q[self.space.columns])

    def _try(self, state: int) -> int:
        """Try one of what is left in a state; returns the state after it."""
        action = int(self.rng.choice(np.flatnonzero(self.left[state])))
        self.left[state, action] -= 1
        if action == self.left.shape[1] - 1:
            outcome, following = reach(self.plant, self.space, MARKER)
            self.missing[state, self.left[state, action]] = outcome.missing
            return following
        _, following = move(self.plant, self.space, state, action)
        self.made[state, action] += 1
        self.failed[state, action] += following != self.space.goals[state, action]
        return following
