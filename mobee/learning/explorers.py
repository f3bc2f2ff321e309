"""Strategies that choose the next action: curiosity, and the two it is compared with (thesis 7.2.1)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from mobee.learning.transitions import TransitionModel
from mobee.robot.robot import Array

TIE = 1e-12


class Explorable(Protocol):
    """What a strategy may look at."""

    model: TransitionModel

    def plan(self) -> tuple[Array, Array]:
        """State and action values under the intrinsic reward, shapes (S,) and (S, A)."""


Explorer = Callable[
    [Explorable, int, np.random.Generator], Array
]  # the score of each action of a state; the highest is chosen, ties at random


def curious(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer what promises the largest discounted information gain."""
    return agent.plan()[1][state, : len(agent.model.space.actions(state))]


def random(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer nothing."""
    return np.zeros(len(agent.model.space.actions(state)))


def least_tried(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer what was tried least often from here."""
    return -agent.model.tries[state, : len(agent.model.space.actions(state))].astype(np.float64)


EXPLORERS: dict[str, Explorer] = {"curious": curious, "random": random, "least_tried": least_tried}


def choose(scores: Array, rng: np.random.Generator) -> int:
    """The action with the highest score, uniformly at random among those within 1e-12 of it."""
    ties = np.flatnonzero(scores >= scores.max() - TIE)
    return int(ties[0] if len(ties) == 1 else ties[int(rng.random() * len(ties))])
