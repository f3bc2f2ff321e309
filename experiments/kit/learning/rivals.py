# SPDX-License-Identifier: Apache-2.0
"""Explorers of the literature for the agent of this library, and tabular worlds with rewards that the agent does not know in advance.

An explorer decides which action an agent takes; each one here is a callable object as described at `mobee.learning.explorers.Explorer`.
`CountBonus`, `RMax` and `EpsilonGreedy` plan with the transition model of `learned`: frequencies of the outcomes that the agent observed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mobee import value_iteration
from mobee.arrays import Array, Ints
from mobee.learning.discrete import DiscreteSpace
from mobee.learning.explorers import Explorable, SampledBeliefs
from mobee.learning.tabular import TabularPlant, TabularWorld
from mobee.plant import Outcome

PRIOR = 1e-6  # count of "the state stays", believed of an action that was never tried, and nearly nothing after a try
PLAN_TOLERANCE = 1e-3  # of plans in sampled models


class RewardedPlant(TabularPlant):
    """A tabular world (an MDP given by tables) with rewards that depend on state and action, and that the agent has to discover."""

    def __init__(self, world: TabularWorld, seed: int) -> None:
        states, actions = world.outcomes.shape[:2]
        super().__init__(DiscreteSpace(states, actions), world.outcomes, world.probabilities, seed)
        self.truth: Array = world.mean_reward
        self.known: Array = np.zeros((states, actions))
        """The reward of each state-action that was tried, and 0 for all others, shape (S, A)."""
        self.earned: list[float] = []
        """The reward of each action so far, in order of time."""
        self.largest = float(self.truth.max())

    def act(self, part: str, target: Array) -> Outcome:
        """Perform an action in the present state, and record its reward; returns the outcome.

        `part`: as in `mobee.plant.Plant.act`.  `target`: (2,), as the space's `aim` returns it: expected state and number of the action.
        """
        at = self.state, int(target[1])
        outcome = super().act(part, target)
        self.known[at] = self.truth[at]
        self.earned.append(float(self.truth[at]))
        return outcome


def learned(agent: Explorable) -> Any:
    """Return a transition model whose probabilities are the frequencies of the outcomes that the agent observed.

    An action that was never tried is believed to stay in its state.  To this end, each action has an imagined outcome with the count
    1e-6: its goal, which is the state itself in the worlds of this module.
    """
    return agent.model.debiased(goal=PRIOR, stay=0.0)


def row(values: Array, state: int) -> Array:
    """Return the values of the actions of one state, (A,), from the values (S, A) of all states."""
    found: Array = values[state]
    return found


@dataclass(frozen=True, eq=False)
class Curious:
    """An explorer with the published curiosity and an external reward: it plans with information gain plus `weight` times that reward.

    The external reward of an action is assumed to be 0 before the first try of the action.
    """

    plant: RewardedPlant
    weight: float

    def __call__(self, agent: Explorable, state: int, rng: np.random.Generator) -> Array:
        """Return the score of each action of a state, (A,): its value in a plan with information gain and known rewards."""
        return row(agent.plan(agent.model.reward + self.weight * self.plant.known)[1], state)


@dataclass(frozen=True, eq=False)
class CountBonus:
    """The explorer MBIE-EB (Strehl and Littman 2008): the reward is the known reward plus `bonus` / sqrt(tries).

    For an action that was never tried, the reward is the largest reward of the world plus `bonus`.
    """

    plant: RewardedPlant
    bonus: float

    def __call__(self, agent: Explorable, state: int, rng: np.random.Generator) -> Array:
        """Return the score of each action of a state, (A,): its value in a plan with known rewards and the bonus."""
        tries = agent.model.tries
        bonus = self.bonus / np.sqrt(np.maximum(tries, 1))
        reward = np.where(tries > 0, self.plant.known + bonus, self.plant.largest + self.bonus)
        return row(agent.plan(reward, learned(agent), key="count bonus")[1], state)


@dataclass(frozen=True, eq=False)
class RMax:
    """The explorer R-MAX (Brafman and Tennenholtz 2002).

    An action with fewer than `known` tries is believed to stay in its state and to have the largest reward of the world.
    """

    plant: RewardedPlant
    known: int

    def __call__(self, agent: Explorable, state: int, rng: np.random.Generator) -> Array:
        """Return the score of each action of a state, (A,): its value in a plan in which actions with few tries have the largest reward."""
        known = agent.model.tries >= self.known
        beliefs = learned(agent)
        probabilities = np.where(known[..., None], beliefs.probabilities, 0.0)
        probabilities[..., 0] += ~known  # the first bin: the state stays
        reward = np.where(known, self.plant.known, self.plant.largest)
        return row(agent.plan(reward, SampledBeliefs(beliefs.outcomes, probabilities), key="rmax")[1], state)


class PosteriorSampling:
    """The explorer PSRL (Osband, Russo and Van Roy 2013): plans with a world that is drawn from the posterior.

    A new world is drawn after every `episode` transitions, an argument of the constructor.  Outcomes of a state-action: Dirichlet
    distribution, with the prior count 1 / S of every state.  Rewards: normal distribution with mean 0 and variance 1 before the first try,
    known after it.
    """

    def __init__(self, plant: RewardedPlant, episode: int) -> None:
        self.plant, self.episode = plant, episode
        self._values = np.zeros(0)

    def __call__(self, agent: Explorable, state: int, rng: np.random.Generator) -> Array:
        """Return the score of each action of a state, (A,): its value in the present sampled world."""
        if agent.transitions % self.episode == 0 or not len(self._values):
            tries, counts = agent.model.tries, all_counts(agent)
            drawn = rng.standard_gamma(counts + 1.0 / counts.shape[2])
            drawn /= drawn.sum(axis=2, keepdims=True)
            reward = np.where(tries > 0, self.plant.known, rng.standard_normal(tries.shape))
            outcomes: Ints = np.broadcast_to(np.arange(counts.shape[2]), counts.shape).copy()
            world = SampledBeliefs(outcomes, drawn)
            self._values = value_iteration(world, reward, agent.discount, PLAN_TOLERANCE, relative=True, method="modified")[1]
        return row(self._values, state)


@dataclass(frozen=True, eq=False)
class EpsilonGreedy:
    """An explorer that takes a random action with probability `share`, else the best one by the outcomes and rewards observed."""

    plant: RewardedPlant
    share: float

    def __call__(self, agent: Explorable, state: int, rng: np.random.Generator) -> Array:
        """Return the score of each action of a state, (A,): its value in a plan with known rewards; with probability `share` all are 0."""
        if rng.random() < self.share:
            return np.zeros(self.plant.known.shape[1])
        return row(agent.plan(self.plant.known, learned(agent), key="greedy")[1], state)


def all_counts(agent: Explorable) -> Array:
    """Return how often each state-action led to each state, (S, A, S).

    Only real outcomes are counted: the imagined outcomes, which are the prior of the agent's model, are subtracted.
    """
    model = agent.model
    real = np.where(model.counts > 0.0, model.counts - model.imagined, 0.0)
    states, actions, _ = real.shape
    counts = np.zeros((states, actions, states))
    s, a, _ = np.indices(real.shape)
    np.add.at(counts, (s, a, model.outcomes), real)
    return counts


def rooms(width: int = 11, slip: float = 0.1) -> TabularWorld:
    """Return a grid world of four rooms, with a door in each wall and actions in four directions.

    The world has `width` x `width` cells, walls included.  A step slips to either side with the probability `slip` each.  The reward 1 is
    in the corner opposite to the start; every action there leads to the start.
    """
    middle, doors = width // 2, (width // 4, width - 1 - width // 4)
    wall = np.zeros((width, width), dtype=bool)
    wall[middle], wall[:, middle] = True, True
    wall[middle, list(doors)] = wall[list(doors), middle] = False
    cells = np.argwhere(~wall)
    number = np.full((width, width), -1)
    number[~wall] = np.arange(len(cells))
    step = np.array([(0, 1), (1, 0), (0, -1), (-1, 0)])
    there = np.clip(cells[:, None] + step, 0, width - 1)
    reached = number[there[..., 0], there[..., 1]]
    reached = np.where(reached < 0, np.arange(len(cells))[:, None], reached)
    outcomes = np.stack([reached, np.roll(reached, -1, axis=1), np.roll(reached, 1, axis=1)], axis=-1)
    probabilities = np.broadcast_to([1.0 - 2.0 * slip, slip, slip], outcomes.shape).copy()
    outcomes[-1], rewards = 0, np.zeros(outcomes.shape)
    rewards[-1] = 1.0
    return TabularWorld(outcomes, probabilities, rewards)


def random_world(seed: int, states: int = 50, actions: int = 4, branches: int = 5) -> TabularWorld:
    """Return a world in which each action leads to `branches` random states with random probabilities (Archibald et al. 1995).

    `seed`: of the draw.  The reward depends only on the state in which an action starts: 0 in state 0, and 1 in the last state.  In each
    other state it is 0 with probability 0.9, else drawn uniformly from 0 to 1.
    """
    rng = np.random.default_rng(seed)
    outcomes = np.array([[rng.choice(states, branches, replace=False) for _ in range(actions)] for _ in range(states)])
    probabilities = rng.dirichlet(np.ones(branches), size=(states, actions))
    rewards = np.where(rng.random(states) < 0.1, rng.random(states), 0.0)
    rewards[0], rewards[-1] = 0.0, 1.0
    return TabularWorld(outcomes, probabilities, np.broadcast_to(rewards[:, None, None], outcomes.shape).copy())
