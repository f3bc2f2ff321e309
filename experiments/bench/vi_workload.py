"""Decision problems for the benchmark of planning: at random, of any size, and what an agent knows at work."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from experiments.kit.learning.arm import arm_space
from mobee import CuriousAgent
from mobee.arrays import Array, Ints
from mobee.learning.tabular import TabularPlant, half_space

ACTIONS = 16
REACH = 64  # how far away, in states, actions of a problem of any size lead


@dataclass(frozen=True, slots=True)
class Row:
    """What is known of one state-action: outcomes and probabilities (B,), and its reward."""

    state: int
    action: int
    outcomes: Ints
    probabilities: Array
    reward: float


@dataclass(frozen=True, slots=True)
class Tables:
    """Outcomes and probabilities, shape (S, A, B), and a reward (S, A)."""

    outcomes: Ints
    probabilities: Array
    reward: Array

    def row(self, state: int, action: int) -> Row:
        """A copy of a row, so that it can be put back."""
        at = state, action
        return Row(state, action, self.outcomes[at].copy(), self.probabilities[at].copy(), float(self.reward[at]))

    def put(self, row: Row) -> None:
        """Change one row in place, as an observation does."""
        at = row.state, row.action
        self.outcomes[at], self.probabilities[at], self.reward[at] = row.outcomes, row.probabilities, row.reward


@dataclass(frozen=True, slots=True)
class Work:
    """A problem, and changes of one row each: those of some observations and, backwards, the same undone."""

    tables: Tables
    changes: tuple[Row, ...]


def work(tables: Tables, observations: Iterable[Row]) -> Work:
    """A problem before the observations, and their changes there and back."""
    forth, back = [], []
    for row in observations:
        forth.append(row)
        back.append(tables.row(row.state, row.action))
        tables.put(row)
    for row in reversed(back):
        tables.put(row)
    return Work(tables, (*forth, *reversed(back)))


def at_random(seed: int) -> tuple[Tables, float]:
    """A problem and a discount: empty bins anywhere, rewards of either sign, states and actions that do not exist."""
    rng = np.random.default_rng(seed)
    shape = tuple(int(rng.integers(2, high)) for high in (40, 9, 7))
    weights = rng.exponential(size=shape) * (rng.random(shape) < 0.7)
    weights[rng.random(shape[0]) < 0.1] = 0.0
    reward = rng.choice([0.01, 1.0, 100.0]) * rng.normal(loc=rng.choice([-2.0, 0.0, 2.0]), size=shape[:2])
    reward[rng.random(shape[:2]) < 0.1] = -np.inf
    totals = weights.sum(axis=-1, keepdims=True)
    tables = Tables(rng.integers(shape[0], size=shape), weights / np.where(totals > 0.0, totals, 1.0), reward)
    return tables, float(rng.choice([0.0, 0.5, 0.9, 0.99]))


def of_size(states: int, observations: int = 3, seed: int = 0) -> Work:
    """16 actions a state to others not far in number, which succeed, stay or end elsewhere."""
    rng = np.random.default_rng(seed)
    goals = (np.arange(states)[:, None] + rng.integers(-REACH, REACH + 1, (states, ACTIONS))) % states
    stay = np.broadcast_to(np.arange(states)[:, None], goals.shape)
    outcomes = np.stack([stay, goals, (goals + 1) % states], axis=-1)
    tables = Tables(outcomes, rng.dirichlet([1.0, 8.0, 0.5], goals.shape), 0.02 * rng.exponential(size=goals.shape))
    certain, some = np.array([0.1, 0.8, 0.1]), rng.integers(states, size=observations).tolist()
    return work(tables, [Row(s, 0, outcomes[s, 0], certain, 0.5 * float(tables.reward[s, 0])) for s in some])


def at_work(transitions: int, observations: int, seed: int = 0) -> Work:
    """What a curious agent of 81 states and 16 actions knows after so many transitions, and its next observations."""
    space = arm_space(neighbours=ACTIONS)
    agent = CuriousAgent(space, TabularPlant(space, *half_space(space), seed=seed), seed=seed)
    agent.run(transitions)
    before, rows = _tables(agent), []
    for _ in range(observations):
        agent.step()
        rows.append(agent.last)
    bins = agent.model.outcomes.shape[2]
    known = _tables(agent)
    wider = ((0, 0), (0, 0), (0, bins - before.outcomes.shape[2]))
    before = Tables(np.pad(before.outcomes, wider), np.pad(before.probabilities, wider), before.reward)
    return work(before, [known.row(one.s, one.a) for one in rows if one is not None])


def _tables(agent: CuriousAgent) -> Tables:
    return Tables(agent.model.outcomes.copy(), agent.model.probabilities.copy(), agent.model.reward.copy())
