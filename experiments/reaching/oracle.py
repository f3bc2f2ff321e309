"""The oracle: an agent that plans and is evaluated as the learners, but knows the mean rewards and the blocked transitions.

It has the same discount, the same beliefs of the free transitions, and the same limit of actions; its score is what a learner could have
that knew all.  It can be beaten by chance, and a little by an agent that knows how transitions fail.
"""

from __future__ import annotations

from typing import Any, NoReturn

import numpy as np

from experiments.reaching.truth import BLOCKED, Truth
from mobee import OfflinePlant, Space
from mobee.errors import InvalidValue
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.value_iteration import OutcomeModel
from mobee.robot.robot import Array


class Known:
    """A predictor that says the true mean rewards (S,) of each of the targets that were measured."""

    def __init__(self, truth: Truth, scale: float) -> None:
        self._rewards: dict[bytes, Array] = dict(
            zip(((place + 0.0).tobytes() for place in truth.places), truth.rewards(scale), strict=True)
        )
        self.settings: dict[str, Any] = {"name": "known", "scale": scale}

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn nothing."""

    def mean(self, target: Array) -> Array:
        """The true mean rewards, shape (S,); raises InvalidValue for a target that was not measured."""
        rewards = self._rewards.get((np.asarray(target, dtype=np.float64) + 0.0).tobytes())
        if rewards is None:
            raise InvalidValue(f"nothing is known of a target at {target} m: measure its truth first.")
        return rewards

    def deviation(self, target: Array) -> Array:
        """None: there is no doubt."""
        return np.zeros_like(self.mean(target))

    def sample(self, target: Array, rng: np.random.Generator) -> NoReturn:
        """Raise InvalidValue: there is nothing to draw."""
        raise InvalidValue("what is known is not drawn.")


def oracle(truth: Truth, space: Space, plant: OfflinePlant, beliefs: OutcomeModel, marker: str, scale: float, seed: int) -> ReachAgent:
    """An agent that needs not learn: `evaluate` it on targets that were measured."""
    known = Known(truth, scale)
    agent = ReachAgent(space, plant, beliefs, marker=marker, predictor=known, strategy="greedy", failures="local", scale=scale, seed=seed)
    for place, blocked in zip(truth.places, truth.blocked, strict=True):
        for state, action in np.argwhere(np.nan_to_num(blocked) >= BLOCKED).tolist():
            agent.failures.add(state, action, place, agent.penalty)
    return agent
