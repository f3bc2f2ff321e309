"""The true rewards of reaches and the transitions that targets block, measured on the plant, and the oracle that plans with them.

Every reach and every transition is tried several times on the offline plant, from where the part came to rest after the action before.
A state from which a try is still to be made is entered with the target in place if a try ends there, else without it.

The oracle is an agent that plans and is evaluated as the learners are, with the same discount, the same model of the free transitions and
the same limit of actions, but knows the mean rewards and the blocked transitions.  Its score is what a learner could have that knew all;
it can be exceeded by chance, and a little by an agent that knows how transitions fail.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from experiments.kit.reaching.arm import MARKER, laws, reach_plant, reach_space
from mobee import OfflinePlant, Space
from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.reaching.evaluation import move, reach
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.value_iteration import OutcomeModel
from mobee.reach import ReachTarget

TRIES = 5  # of everything
SEED = 9001  # no learner has it
CARRIES = 3  # attempts to enter a state
BLOCKED = 0.5  # share of tries that do not end in their goal, from which a transition counts as blocked


@dataclass(frozen=True, slots=True, eq=False)
class Tried:
    """Measured results of one target.

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
    """The truth about several targets.

    `places`: (T, 3) m.  `missing`: (T, S, n) m, NaN where a state was not entered.  `blocked`: (T, S, A) share of failures, NaN where
    nothing was tried.
    """

    places: Array
    missing: Array
    blocked: Array

    def rewards(self, scale: float) -> Array:
        """The mean reward of reaching from each state, shape (T, S) (thesis eq. 8.4); 0 where the state was not entered."""
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
    """The truth from the measured values of cells, by place."""
    each = list(measured.values())
    made = np.array([one["made"] for one in each])
    with np.errstate(invalid="ignore"):
        blocked = np.array([one["failed"] for one in each]) / made
    return Truth(np.array(list(measured)), np.array([one["missing"] for one in each]), blocked)


def measure(place: Array, law: str = "published", tries: int = TRIES, seed: int = SEED) -> Tried:
    """Make so many tries of every reach and every transition with the target at a place (3,) m."""
    target = ReachTarget(place, aim=laws()[law].aim)
    return _Measuring(reach_space(), reach_plant(seed, law), target, tries, seed).run()


class _Measuring:
    """A measurement: the remaining tries, and the results so far."""

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
        """Go without the target to a state with remaining tries; one that cannot be entered is given up."""
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
        return self.space.state_of(outcome.q)

    def _try(self, state: int) -> int:
        """Make one of the remaining tries of a state; returns the state after it."""
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


class Known:
    """A predictor that returns the true mean rewards (S,) of each measured target."""

    def __init__(self, truth: Truth, scale: float) -> None:
        self._rewards: dict[bytes, Array] = dict(
            zip(((place + 0.0).tobytes() for place in truth.places), truth.rewards(scale), strict=True)
        )
        self.settings: dict[str, Any] = {"name": "known", "scale": scale}

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn nothing."""

    def mean(self, target: Array) -> Array:
        """The true mean rewards, shape (S,); raises InvalidValue for a target that was not measured."""
        rewards = self._rewards.get((np.asarray(target, dtype=np.float64) + 0.0).tobytes())
        if rewards is None:
            raise InvalidValue(f"nothing is known of a target at {target} m: measure its truth first.")
        return rewards

    def deviation(self, target: Array) -> Array:
        """Zeros: nothing is uncertain."""
        return np.zeros_like(self.mean(target))

    def sample(self, target: Array, rng: np.random.Generator) -> NoReturn:
        """Raise InvalidValue: there is no distribution to draw from."""
        raise InvalidValue("what is known is not drawn.")


def oracle(truth: Truth, space: Space, plant: OfflinePlant, beliefs: OutcomeModel, marker: str, scale: float, seed: int) -> ReachAgent:
    """An agent with true rewards and true failures, for `evaluate` on measured targets."""
    known = Known(truth, scale)
    agent = ReachAgent(space, plant, beliefs, marker=marker, predictor=known, strategy="greedy", failures="local", scale=scale, seed=seed)
    for place, blocked in zip(truth.places, truth.blocked, strict=True):
        for state, action in np.argwhere(np.nan_to_num(blocked) >= BLOCKED).tolist():
            agent.failures.add(state, action, place, agent.penalty)
    return agent
