"""An explorer that believes, for a while, a world drawn at random among those that fit its observations."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mobee.learning.explorable import Explorable
from mobee.robot.robot import Array, Ints


@dataclass(frozen=True, slots=True)
class SampledBeliefs:
    """Probabilities (S, A, B) drawn for the outcomes (S, A, B) of a transition model."""

    outcomes: Ints
    probabilities: Array


def posterior_sampling(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer what promises the largest discounted information gain in a world drawn from the posterior (Strens 2000).

    The world is held for an episode of 1 / (1 - discount) transitions: its random numbers are, while the counts go on.
    """
    model = agent.model
    episode = agent.transitions // round(1.0 / (1.0 - agent.discount))
    normal = _normal(agent.seed, zlib.crc32(agent.part.encode()), episode, model.counts.shape)
    beliefs = SampledBeliefs(model.outcomes, dirichlet(model.counts, normal))
    return agent.plan(model.reward, beliefs, key="posterior_sampling")[1][state, : len(model.space.actions(state))]


def dirichlet(counts: Array, normal: Array) -> Array:
    """One draw of the probabilities (..., B) with these counts (..., B) from standard normal numbers of the same shape.

    Gamma variates by Wilson and Hilferty's cube root (1931), near enough for counts from 1: the same numbers give
    probabilities that move little when the counts do.  Where there is no count the probability is 0.
    """
    known = np.maximum(counts, 1.0)
    gamma = np.maximum(1.0 - 1.0 / (9.0 * known) + normal / (3.0 * np.sqrt(known)), 1e-3)
    weights: Array = counts * gamma * gamma * gamma
    weights /= np.maximum(weights.sum(axis=-1, keepdims=True), np.finfo(np.float64).tiny)
    return weights


@lru_cache(maxsize=4)
def _normal(seed: int, part: int, episode: int, shape: tuple[int, ...]) -> Array:
    """The random numbers of an episode: those of the bins that were there stay when another is added."""
    drawn = np.random.default_rng([seed, part, episode]).standard_normal((shape[2], *shape[:2]))
    return np.ascontiguousarray(np.moveaxis(drawn, 0, -1))
