"""A learner that is looked at while it learns: what it did in its problem-tries, and how it reached whenever it was evaluated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mobee.learning.reaching.evaluation import NOWHERE, Evaluation
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.tries import Try
from mobee.reach import ReachTarget
from mobee.robot.robot import Ints


def learn(
    agent: ReachAgent, problems: Sequence[ReachTarget], looks: Sequence[int], repetitions: int, sets: Mapping[str, Sequence[ReachTarget]]
) -> dict[str, Any]:
    """Let it learn from the problems, and evaluate it on each of the named sets after so many problem-tries.

    Returns arrays: of the T problem-tries `problem`, `reach_state`, `reward`, `actions`, `duration` (s), each (T,); `failures`
    (S, A), how often each transition failed in them; and of a set `rewards_NAME` and `states_NAME`, (L, R, P), and
    `blocked_NAME` (L,), failed transitions of the L evaluations of R repetitions of P problems.
    """
    tries: list[Try] = []
    found: dict[str, list[Evaluation]] = {name: [] for name in sets}
    for look in looks:
        while len(tries) < look:
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
    """The evaluations on a set as arrays."""
    return {
        f"rewards_{name}": np.array([one.rewards for one in evaluations]),
        f"states_{name}": np.array([one.states for one in evaluations], dtype=np.int16),
        f"blocked_{name}": np.array([one.failures.sum() for one in evaluations]),
    }


def _numbers(agent: ReachAgent, problems: Sequence[ReachTarget]) -> Ints:
    """Where each problem of the agent, which numbers them as they come, stands among these."""
    order = {problem.position.tobytes(): number for number, problem in enumerate(problems)}
    return np.array([order[target.position.tobytes()] for target in agent.problems.targets], dtype=np.int16)


def _of_tries(tries: Sequence[Try], shape: tuple[int, ...]) -> dict[str, Any]:
    failures = np.zeros(shape, dtype=np.int32)
    for one in tries:
        for state, action, _, failed in one.path:
            failures[state, action] += failed
    return {
        "reach_state": np.array([NOWHERE if one.reach_state is None else one.reach_state for one in tries], dtype=np.int16),
        "reward": np.array([one.reward for one in tries], dtype=np.float32),
        "actions": np.array([len(one.path) + (one.reach_state is not None) for one in tries], dtype=np.int16),
        "duration": np.array([one.duration for one in tries], dtype=np.float32),
        "failures": failures,
    }
