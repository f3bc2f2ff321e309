"""Strategies that choose the next action: curiosity, what the thesis compares it with (7.2.1), anchors, and one of our own."""

from __future__ import annotations

import numpy as np

from mobee.learning.depleting import depleting
from mobee.learning.explorable import Explorable, Explorer
from mobee.learning.posterior import posterior_sampling
from mobee.robot.robot import Array

TIE = 1e-12


def curious(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer what promises the largest discounted information gain."""
    return agent.plan()[1][state, : len(agent.model.space.actions(state))]


def random(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer nothing."""
    return np.zeros(len(agent.model.space.actions(state)))


def least_tried(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer what was tried least often from here."""
    return -agent.model.tries[state, : len(agent.model.space.actions(state))].astype(np.float64)


def nearest_untried(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer what leads soonest to a state-action that nobody has tried; when there is none, to the least tried of all."""
    tries = agent.model.tries
    exists = agent.model.reward != -np.inf
    reward = np.where(exists, tries == tries[exists].min(), -np.inf)
    return agent.plan(reward, key="nearest_untried")[1][state, : len(agent.model.space.actions(state))]


def count_bonus(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer what promises the largest discounted sum of 1 / sqrt(1 + tries) (Strehl and Littman 2008)."""
    reward = np.where(agent.model.reward != -np.inf, 1.0 / np.sqrt(1.0 + agent.model.tries), -np.inf)
    return agent.plan(reward, key="count_bonus")[1][state, : len(agent.model.space.actions(state))]


EXPLORERS: dict[str, Explorer] = {
    "curious": curious,
    "random": random,
    "least_tried": least_tried,
    "nearest_untried": nearest_untried,
    "count_bonus": count_bonus,
    "posterior_sampling": posterior_sampling,
    "depleting": depleting,
}


def choose(scores: Array, rng: np.random.Generator) -> int:
    """The action with the highest score, uniformly at random among those within 1e-12 of it."""
    listed = scores.tolist()  # NumPy takes longer for so few numbers
    least = max(listed) - TIE
    ties = [action for action, score in enumerate(listed) if score >= least]
    return ties[0] if len(ties) == 1 else ties[int(rng.random() * len(ties))]
