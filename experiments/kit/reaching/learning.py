# SPDX-License-Identifier: Apache-2.0
"""Learning to reach in experiments: learners by name, learning with evaluations, and single tries to reach a target without learning."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.explorers import choose
from mobee.learning.reaching.failures import has_failed
from mobee.learning.reaching.reach_agent import NO_STATE, Evaluation, ReachAgent, move
from mobee.learning.reaching.store import Try
from mobee.plant import Plant
from mobee.reach import ReachTarget

MAX_ACTIONS = 10  # of a try, its reach included


@dataclass(frozen=True)
class Learner:
    """The kind of a reach learner: names of its predictor, strategy and memory of failures, which are arguments of `ReachAgent`.

    `cost`: expected duration of a run, relative to the other learners.
    """

    predictor: str
    strategy: str
    failures: str = "local"
    cost: float = 1.0

    def agent(self, *given: Any, **settings: Any) -> ReachAgent:
        """Return a `ReachAgent` with this predictor, strategy and memory of failures.

        `given`, `settings`: the other arguments of `ReachAgent`, by position and by name.
        """
        return ReachAgent(*given, predictor=self.predictor, strategy=self.strategy, failures=self.failures, **settings)


LEARNERS = {
    "published": Learner("weighted", "intrinsic", "spread"),
    "intrinsic": Learner("weighted", "intrinsic"),
    "greedy": Learner("weighted", "greedy"),
    "table": Learner("table", "greedy"),
    "kernel-random": Learner("kernel", "random", cost=2.0),
    "kernel-ucb": Learner("kernel", "ucb"),
    "kernel-prior-ucb": Learner("kernel_prior", "ucb"),
    "nearest-ucb": Learner("nearest", "ucb"),
    "networks-thompson": Learner("networks", "thompson", cost=2.0),
    "gp-greedy": Learner("gp", "greedy", cost=2.0),
    "gp-ucb": Learner("gp", "ucb", cost=2.0),
    "gp-ucb-alike": Learner("gp", "ucb", "alike", cost=2.0),
    "gp-thompson": Learner("gp", "thompson", cost=2.0),
    "gp-progress": Learner("gp", "progress", cost=2.0),
    "gp-ucb-spread": Learner("gp", "ucb", "spread", cost=2.0),
}


def learn(
    agent: ReachAgent,
    problems: Sequence[ReachTarget],
    checkpoints: Sequence[int],
    repetitions: int,
    sets: Mapping[str, Sequence[ReachTarget]],
) -> dict[str, Any]:
    """Let an agent learn from `problems`, and evaluate it on each of the named `sets` at every checkpoint.

    `checkpoints`: (L,) numbers of problem-tries after which the agent is evaluated, ascending.  A problem-try is one attempt to reach one
    target.  `repetitions`: R, how often an evaluation attempts each target of a set.  Returns arrays by name.  For each of the T
    problem-tries, (T,): `problem`: index of the target in `problems`; `reach_state`: state from which the agent reached, -1 if it did not;
    `reward`; `actions`: number of actions; `duration` [s].  `failures` (S, A): number of failures of each transition.  For each set NAME of
    P targets: `rewards_NAME` (L, R, P): rewards of the reaches, 0 without a reach; `states_NAME` (L, R, P): states from which the agent
    reached, -1 without a reach; `blocked_NAME` (L,): number of failed transitions.
    """
    tries: list[Try] = []
    found: dict[str, list[Evaluation]] = {name: [] for name in sets}
    for checkpoint in checkpoints:
        while len(tries) < checkpoint:
            agent.learn(problems, 1)
            assert agent.last is not None
            tries.append(agent.last)
        for name, evaluated in sets.items():
            found[name].append(agent.evaluate(evaluated, repetitions))
    values = _of_tries(tries, agent.space.goals.shape) | {"problem": _numbers(agent, problems)[[one.problem for one in tries]]}
    for name, evaluations in found.items():
        values |= of_evaluations(name, evaluations)
    return values


def of_evaluations(name: str, evaluations: Sequence[Evaluation]) -> dict[str, Any]:
    """Return the results of L evaluations on the set `name` as arrays, for R repetitions of P problems.

    Keys: `rewards_NAME` (L, R, P): rewards of the reaches, 0 without a reach; `states_NAME` (L, R, P): states from which the agent reached,
    -1 without a reach; `blocked_NAME` (L,): number of failed transitions.
    """
    return {
        f"rewards_{name}": np.array([one.rewards for one in evaluations]),
        f"states_{name}": np.array([one.states for one in evaluations], dtype=np.int16),
        f"blocked_{name}": np.array([one.failures.sum() for one in evaluations]),
    }


def _numbers(agent: ReachAgent, problems: Sequence[ReachTarget]) -> Ints:
    """Return the index of each of the agent's problems in this sequence."""
    order = {problem.position.tobytes(): number for number, problem in enumerate(problems)}
    return np.array([order[target.position.tobytes()] for target in agent.problems.targets], dtype=np.int16)


def _of_tries(tries: Sequence[Try], shape: tuple[int, ...]) -> dict[str, Any]:
    failures = np.zeros(shape, dtype=np.int32)
    for one in tries:
        for state, action, _, failed in one.path:
            failures[state, action] += failed
    return {
        "reach_state": np.array([NO_STATE if one.reach_state is None else one.reach_state for one in tries], dtype=np.int16),
        "reward": np.array([one.reward for one in tries], dtype=np.float32),
        "actions": np.array([len(one.path) + (one.reach_state is not None) for one in tries], dtype=np.int16),
        "duration": np.array([one.duration for one in tries], dtype=np.float32),
        "failures": failures,
    }


class Course:
    """One try to reach a target, as in an evaluation (thesis 8.3.3), on any plant.  The target may move; the agent learns nothing.

    A new plan is made before every action.  The part moves to the state with the highest expected reward of reaching.  Within the try, it
    avoids transitions that failed, and states from which reaches missed.

    Args:
        plant: the robot.
        agent: the agent whose transition model and planning are used.
        worth: function that returns the expected reward (S,) of reaching for a target (3,) m from each state.
        where: function that returns the present position of the target, (3,) m, root frame.
        rng: for the choice among equally good actions.
        apart: after a missed reach, the state from which it was made is avoided, and all states within this distance of it.  The distance
            of two states is the sum over the motors of the absolute differences, each as a share of the motor's range.
    """

    def __init__(
        self,
        plant: Plant,
        agent: ReachAgent,
        worth: Callable[[Array], Array],
        where: Callable[[], Array],
        rng: np.random.Generator,
        apart: float = 0.0,
    ) -> None:
        self._plant, self._agent, self._worth, self._where, self._rng = plant, agent, worth, where, rng
        self._failures = agent.failures.copy()
        self._state = -1
        self._spent = np.zeros(len(agent.space), dtype=bool)
        self._apart = apart
        self.actions = 0
        """Number of transitions made so far."""
        self.thinking = 0.0
        """Processor time spent on plans so far, s."""

    def go(self) -> None:
        """Make transitions until the plan is to reach from the present state, but at most 9; a new plan is made before each transition.

        The reach itself is not made.
        """
        space = self._agent.space
        self._state = space.state_of(self._plant.measure(space.part))
        for _ in range(MAX_ACTIONS - 1):
            target, asked = self._where(), time.process_time()
            worth = np.maximum(self._worth(target), 0.0)
            worth[self._spent] = 0.0
            values, action_values = self._agent.planning.values(worth, self._failures.rewards(target, float(worth.max())))
            action = choose(action_values[self._state], self._rng)
            self.thinking += time.process_time() - asked
            if action == space.goals.shape[1]:
                return
            self.actions += 1
            _, following = move(self._plant, space, self._state, action)
            failed = has_failed(values, self._state, following)
            self._failures.add(self._state, action, target, self._agent.penalty if failed else 0.0)
            self._state = following

    def missed(self) -> None:
        """Record that a reach from the present state missed: in this try, reaches from it and from states near it are avoided."""
        space = self._agent.space
        spans = np.ptp(space.robot.limits[space.robot.part(space.part).slice][space.columns], axis=1)
        distances = np.abs(space.samples - space.samples[self._state]) / spans
        self._spent |= distances.sum(axis=1) <= self._apart + 1e-9
