# SPDX-License-Identifier: Apache-2.0
"""Evaluates what a reach learner has learned, without changing the learner (thesis 8.3.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.explorers import choose
from mobee.learning.reaching.failures import has_failed
from mobee.learning.space import Space
from mobee.plant import Outcome, Plant
from mobee.reach import ReachOutcome, ReachPlant, ReachTarget, reward_of

if TYPE_CHECKING:
    from mobee.learning.reaching.reach_agent import ReachAgent


def move(plant: Plant, space: Space, state: int, action: int) -> tuple[Outcome, int]:
    """Perform an action of a state on the plant; return its outcome and the state in which it ended."""
    outcome = plant.act(space.part, space.target(space.goal(state, action)))
    return outcome, space.state_of(outcome.q)


def reach(plant: ReachPlant, space: Space, marker: str) -> tuple[ReachOutcome, int]:
    """Reach with a marker for the target that the plant presents; return the outcome, and the state in which the part then rests."""
    outcome = plant.reach(space.part, marker)
    return outcome, space.state_of(outcome.after.q)


NO_STATE = -1  # instead of a state, where no reach was made


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """The results of an evaluation: arrays (R, P) for R repetitions of P problems (targets to reach).

    `rewards`: reward of the reach; 0 if no reach was made. `states`: state from which the reach started; -1 without a reach. `missing`: m,
    remaining distance after the reach; NaN without a reach. `failures`: number of failed transitions; a transition has failed if it leads
    to a state with no higher value in the plan. `actions`: number of transitions, plus 1 if a reach was made. `duration`: s, by the plant's
    clock.
    """

    rewards: Array
    states: Ints
    missing: Array
    failures: Ints
    actions: Ints
    duration: Array

    @property
    def scores(self) -> Array:
        """The sum of the rewards of all problems in each repetition, shape (R,), as in thesis figure 8.2."""
        total: Array = self.rewards.sum(axis=1)
        return total


def evaluate(agent: ReachAgent, problems: Sequence[ReachTarget], repetitions: int) -> Evaluation:
    """Let an agent attempt to reach every target (problem) once in each repetition, in random order; return the results.

    Before each repetition the part moves towards a random state, with at most `agent.limit` actions. Each further attempt starts in the
    state in which the previous one ended. The agent does not learn from this: which transitions fail is recorded in a copy of
    `agent.failures`, and the copy is discarded at the end of the repetition.
    """
    shape = repetitions, len(problems)
    found = Evaluation(
        np.zeros(shape),
        np.full(shape, NO_STATE),
        np.full(shape, np.nan),
        np.zeros(shape, np.intp),
        np.zeros(shape, np.intp),
        np.zeros(shape),
    )
    for repetition in range(repetitions):
        rng = np.random.default_rng([agent.seed, agent.tries, repetition])
        trial = _Trial(agent, rng)
        trial.go_to(int(rng.integers(len(agent.space))))
        for problem in rng.permutation(len(problems)).tolist():
            trial.reach_for(problems[problem], found, (repetition, problem))
    return found


class _Trial:
    """One repetition, with the state of the part and the transitions that failed in it."""

    def __init__(self, agent: ReachAgent, rng: np.random.Generator) -> None:
        self.agent, self.rng, self.failures = agent, rng, agent.failures.copy()
        self.state = agent.space.state_of(agent.plant.measure(agent.part))

    def go_to(self, goal: int) -> None:
        """Go to a state without a presented target, or as far as the limit of actions allows."""
        agent = self.agent
        agent.plant.present(None)
        arrived = np.full(len(agent.space), -np.inf)
        arrived[goal] = 1.0
        _, action_values = agent.planning.values(arrived, 0.0)
        for _ in range(agent.limit):
            if self.state == goal:
                return
            action = choose(action_values[self.state], self.rng)
            _, self.state = move(agent.plant, agent.space, self.state, action)

    def reach_for(self, target: ReachTarget, found: Evaluation, at: tuple[int, int]) -> None:
        """Make one problem-try with the present expected rewards."""
        agent, position = self.agent, target.position
        agent.plant.present(target)
        expected = np.maximum(agent.predictor.mean(position), 0.0)
        values, action_values = agent.planning.values(expected, self.failures.rewards(position, float(expected.max())))
        for _ in range(agent.limit):
            found.actions[at] += 1
            action = choose(action_values[self.state], self.rng)
            if action == agent.space.goals.shape[1]:
                reached, following = reach(agent.plant, agent.space, agent.marker)
                found.rewards[at], found.states[at] = reward_of(reached.missing, agent.reaches.scale), self.state
                found.missing[at] = reached.missing
                found.duration[at] += reached.duration
                self.state = following
                return
            outcome, following = move(agent.plant, agent.space, self.state, action)
            found.duration[at] += outcome.duration
            failed = has_failed(values, self.state, following)
            self.failures.add(self.state, action, position, agent.penalty if failed else 0.0, outcome.touched)
            self.state = following
            if failed:
                found.failures[at] += 1
                values, action_values = agent.planning.values(expected, self.failures.rewards(position, float(expected.max())))
