# SPDX-License-Identifier: Apache-2.0
"""The true rewards of reaches, and the transitions that targets block, both measured on the plant; and the oracle that plans with them.

Every reach and every transition is tried several times on the offline plant.  Each try starts where the last action ended.  The target
stays in the world as long as the arm is in a state with remaining tries.  Otherwise the target is removed, the arm moves to a state with
remaining tries, and the target is put back.

The oracle is an agent that plans and is evaluated like the learners, with the same discount, limit of actions, and model of transitions
without targets.  But it knows the mean rewards and the blocked transitions.  Its score is an upper bound for learners.  A learner can
exceed it by chance, or slightly by its knowledge of failures: the oracle only knows which transitions failed in at least half of the tries.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from experiments.kit.reaching.arm import MARKER, laws, reach_plant, reach_space
from mobee import OfflinePlant, Space
from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.reaching.reach_agent import ReachAgent, move, reach
from mobee.learning.value_iteration import OutcomeModel
from mobee.reach import ReachPlant, ReachTarget

TRIES = 5  # of every reach and transition
SEED = 9001  # not used by learners
MAX_ENTRIES = 3  # attempts to enter a state
BLOCKED = 0.5  # share of failed tries from which a transition counts as blocked


@dataclass(frozen=True, slots=True, eq=False)
class Tried:
    """Results of trying every reach and every transition with one target in the world; S states with up to A actions.

    `missing`: (S, n) m, distances of the marker from the target after n tries to reach from each state; NaN for tries that were not made.
    `made`: (S, A), number of tries of each transition.  `failed`: (S, A), number of these tries that did not end in the goal of the
    transition.
    """

    missing: Array
    made: Ints
    failed: Ints

    def values(self) -> dict[str, Any]:
        """Return the results by field, as the values of a cell (one run of a sweep)."""
        return {"missing": self.missing, "made": self.made, "failed": self.failed}


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """Results of trying every reach and every transition with each of T targets in the world, one at a time.

    `places`: (T, 3) m, root frame, of the targets.  `missing`: (T, S, n) m, distances of the marker from the target after n tries to reach
    (the remaining errors); NaN where a state was not entered.
    `blocked`: (T, S, A), share of the tries of each transition that failed; NaN without tries.
    """

    places: Array
    missing: Array
    blocked: Array

    def rewards(self, scale: float) -> Array:
        """Return the mean reward of reaching from each state, (T, S) (thesis eq. 8.4); 0 where the state was not entered.

        The reward of one reach is 1 / (1 + remaining error / scale).  `scale`: m, the remaining error for which the reward is 1/2.
        """
        found = 1.0 / (1.0 + self.missing / scale)
        tried = np.isfinite(found)
        mean: Array = np.where(tried, found, 0.0).sum(axis=-1) / np.maximum(tried.sum(axis=-1), 1)
        return mean

    def save(self, path: Path) -> None:
        """Write the results to a .npz file."""
        np.savez_compressed(path, places=self.places, missing=self.missing, blocked=self.blocked)


def load_truth(path: Path) -> Truth:
    """Return the results in a .npz file that `Truth.save` wrote."""
    with np.load(path) as file:
        return Truth(file["places"], file["missing"], file["blocked"])


def truth_of(measured: Mapping[tuple[float, ...], Mapping[str, Any]]) -> Truth:
    """Return the measured results of several targets as one object.

    `measured`: a dict from the position of a target (3,) m to the values of its cell (one run of a sweep), as `Tried.values` returns them.
    """
    each = list(measured.values())
    made = np.array([one["made"] for one in each])
    with np.errstate(invalid="ignore"):
        blocked = np.array([one["failed"] for one in each]) / made
    return Truth(np.array(list(measured)), np.array([one["missing"] for one in each]), blocked)


def measure(place: Array, law: str = "published", tries: int = TRIES, seed: int = SEED) -> Tried:
    """Try every reach and every transition `tries` times, with the target at a place (3,) m, root frame, and return the results.

    `law`: control law, "published" or "default"; with both, the robot is the one published in 2014.  `seed`: seed of the plant and of
    random choices.
    """
    target = ReachTarget(place, aim=laws()[law].aim)
    return _Measuring(reach_space(), reach_plant(seed, law), target, tries, seed).run()


class _Measuring:
    """Measures every reach and every transition on the plant, with one target in the world; `run` returns the results.

    `left`: (S, A + 1), number of tries that are left for each transition, and in the last column for the reach from each state.  `missing`,
    `made`, `failed`: the results so far, as in `Tried`.
    """

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
        state = self._go(int(self.rng.integers(len(self.space))))
        while self.left.any():
            if not self.left[state].any():
                state = self._enter()
            self.plant.present(self.target)
            while self.left[state].any():
                state = self._try(state)
        return Tried(self.missing, self.made, self.failed)

    def _enter(self) -> int:
        """Remove the target, act towards a random state with remaining tries, and return the state in which the arm ends.

        If three attempts (MAX_ENTRIES) end in states without remaining tries, the remaining tries of the goal state are given up.
        """
        self.plant.present(None)
        goal = int(self.rng.choice(np.flatnonzero(self.left.any(axis=1))))
        for _ in range(MAX_ENTRIES):
            state = self._go(goal)
            if self.left[state].any():
                return state
        self.left[goal] = 0
        return state

    def _go(self, goal: int) -> int:
        """Act towards a state from the current pose; returns the state reached."""
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
    """A predictor that returns the true mean rewards (S,) of each measured target.

    `truth`: the measured results.  `scale`: m, the remaining error for which the reward is 1/2, as in `Truth.rewards`.
    """

    def __init__(self, truth: Truth, scale: float) -> None:
        self._rewards: dict[bytes, Array] = dict(
            zip(((place + 0.0).tobytes() for place in truth.places), truth.rewards(scale), strict=True)
        )
        self.settings: dict[str, Any] = {"name": "known", "scale": scale}

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Do nothing: the rewards are known already."""

    def mean(self, target: Array) -> Array:
        """Return the true mean reward of reaching for a target (3,) m from each state, (S,).

        Raises InvalidValue for a target that was not measured.
        """
        rewards = self._rewards.get((np.asarray(target, dtype=np.float64) + 0.0).tobytes())
        if rewards is None:
            raise InvalidValue(f"the target at {target} m was not measured: measure it first.")
        return rewards

    def deviation(self, target: Array) -> Array:
        """Return zeros (S,): nothing is uncertain."""
        return np.zeros_like(self.mean(target))

    def sample(self, target: Array, rng: np.random.Generator) -> NoReturn:
        """Raise InvalidValue: there is no distribution to draw from."""
        raise InvalidValue("known rewards have no distribution to draw from.")


def oracle(truth: Truth, space: Space, plant: ReachPlant, beliefs: OutcomeModel, marker: str, scale: float, seed: int) -> ReachAgent:
    """Return an agent that knows the true rewards and the blocked transitions of the targets in `truth`.

    It is to be evaluated on these targets only, not to learn.  `truth`: the measured results.  `space`, `plant`: the states and the plant
    of the agent.  `beliefs`: the transition model of the world without targets, with which the agent plans.  `marker`: name of the marker
    that reaches.  `scale`: m, the remaining error for which the reward is 1/2 (thesis eq. 8.4).  `seed`: of the agent.  A transition is
    regarded as blocked if at least half of its tries failed.
    """
    known = Known(truth, scale)
    agent = ReachAgent(space, plant, beliefs, marker=marker, predictor=known, strategy="greedy", failures="local", scale=scale, seed=seed)
    for place, blocked in zip(truth.places, truth.blocked, strict=True):
        for state, action in np.argwhere(np.nan_to_num(blocked) >= BLOCKED).tolist():
            agent.failures.add(state, action, place, agent.penalty)
    return agent


Enter = Callable[[int], bool]  # goes to a state, and returns whether it was entered


def remaining_errors(plant: ReachPlant, space: Space, targets: Sequence[ReachTarget], enter: Enter | None = None) -> Array:
    """Make one reach from each of the S states for each of the T targets; returns the remaining errors, (T, S) m.

    A remaining error is the distance of the marker from the target after the reach; NaN where the state was not entered.  The plant moves.
    `enter`: function that takes a state, moves the plant to it, and returns True if the plant arrived there.  None: the target is removed,
    and up to three actions are made to arrive there.
    """
    enter = enter or partial(_entered, plant, space)
    missing = np.full((len(targets), len(space)), np.nan)
    for state in range(len(space)):
        inside = enter(state)
        for number, target in enumerate(targets):
            if not inside and not (inside := enter(state)):
                break
            plant.present(target)
            outcome, following = reach(plant, space, MARKER)
            missing[number, state], inside = outcome.missing, following == state
    return missing


def failed_transitions(plant: ReachPlant, space: Space, tries: int, enter: Enter | None = None) -> Array:
    """Try each transition without a target, and return the share of the tries that did not end in its goal, (S, A).

    `tries`: number of tries of each transition.  Tries that could not be made, because a state was not entered, count as successes.
    `enter`: function that takes a state, moves the plant to it, and returns True if the plant arrived there.  None: up to three actions are
    made to arrive there.
    """
    enter = enter or partial(_entered, plant, space)
    rng = np.random.default_rng(0)
    left, failed = tries * (space.goals != NO_ACTION), np.zeros(space.goals.shape)
    plant.present(None)
    plant.act(space.part, space.target(int(np.random.default_rng(0).integers(len(space)))))
    while left.any():
        state = space.state_of(plant.measure(space.part))
        if not left[state].any():
            goal = int(rng.choice(np.flatnonzero(left.any(axis=1))))
            if not enter(goal):
                left[goal] = 0
            continue
        action = int(rng.choice(np.flatnonzero(left[state])))
        left[state, action] -= 1
        failed[state, action] += move(plant, space, state, action)[1] != space.goals[state, action]
    return failed / tries


def _entered(plant: ReachPlant, space: Space, state: int) -> bool:
    """Go to a state without a target, in at most three actions; return whether it was entered."""
    plant.present(None)
    return any(space.state_of(plant.act(space.part, space.target(state)).q) == state for _ in range(MAX_ENTRIES))
