"""What a strategy that chooses actions may look at, and what it gives back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import OutcomeModel
from mobee.robot.robot import Array


class Explorable(Protocol):
    """An agent, as its explorer sees it."""

    model: TransitionModel
    beliefs: OutcomeModel
    discount: float
    seed: int
    part: str
    transitions: int

    def plan(self, reward: Array | None = None, beliefs: OutcomeModel | None = None, key: str = "curious") -> tuple[Array, Array]:
        """State and action values, (S,) and (S, A), under a reward (S, A) and beliefs, else the agent's own.

        Plans of one key start from the values of the one before.
        """


Explorer = Callable[[Explorable, int, np.random.Generator], Array]
"""Gives the score of each action of a state, shape (actions,).  The highest is chosen, ties at random.

The scores follow from the agent's settings and its transitions so far alone; the generator is the transition's own.
"""
