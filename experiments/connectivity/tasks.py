"""Going from one state to another by a plan over a learned model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee import InvalidValue, OfflinePlant, Space, TransitionModel, value_iteration

DISCOUNT, TOLERANCE = 0.9, 1e-6


@dataclass(frozen=True)
class Tasks:
    """Pairs of different states: from, to."""

    pairs: list[tuple[int, int]]

    @classmethod
    def drawn(cls, space: Space, count: int, seed: int) -> Tasks:
        """At random."""
        rng = np.random.default_rng(seed)
        return cls([(int(a), int(b)) for a, b in (rng.choice(len(space), 2, replace=False) for _ in range(count))])


def fewest_actions(space: Space, start: int, goal: int) -> int:
    """How many actions lead from one state to another if each brings the part to its goal."""
    reached, count = {start}, 0
    while goal not in reached:
        further = {int(to) for state in reached for to in space.actions(state)} | reached
        if further == reached:
            raise InvalidValue(f"no actions lead from state {start} to {goal} of {space.part}.")
        reached, count = further, count + 1
    return count


@dataclass(frozen=True)
class Attempt:
    """Whether the goal was reached, with how many actions."""

    reached: bool
    actions: int


def attempt(model: TransitionModel, plant: OfflinePlant, start: int, goal: int, most: int) -> Attempt:
    """Go to `start` directly, then by the plan to `goal` with at most that many actions; the model stays as it is.

    The plan maximises the discounted probability of coming into the goal state, by what was really observed.
    """
    space = model.space
    beliefs = model.debiased()
    arriving = np.where(beliefs.outcomes == goal, beliefs.probabilities, 0.0).sum(axis=-1)
    reward = np.where(beliefs.probabilities.any(axis=-1), arriving, -np.inf)
    scores = value_iteration(beliefs, reward, DISCOUNT, TOLERANCE)[1]
    state = space.state_of(plant.act(space.part, space.target(start)).q[space.columns])
    for done in range(most + 1):
        if state == goal:
            return Attempt(True, done)
        if done < most:
            action = int(np.argmax(scores[state]))
            state = space.state_of(plant.act(space.part, space.target(space.goal(state, action))).q[space.columns])
    return Attempt(False, most)
