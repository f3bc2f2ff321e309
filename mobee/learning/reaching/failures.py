"""Which transitions fail on which targets, as negative rewards (thesis 8.1)."""

from __future__ import annotations

from typing import Literal

import numpy as np

from mobee.errors import UnknownName
from mobee.learning.reaching.alike import AlikeFailures
from mobee.learning.reaching.histories import Histories
from mobee.learning.reaching.predictors.predictor import Reaches
from mobee.learning.space import Space
from mobee.robot.robot import Array

FAILURES = ("spread", "local", "alike")
NEAR = 0.025  # m: targets of the published size this near one another are in the way of nearly the same


class Failures:
    """Histories of all transitions: 0 for each success and a penalty for each failure, by target.

    Args:
        states, actions: of the space.
        scale: m, the unit of distances.
        kind: "spread": every failure tells a little of every target (thesis eq. 8.1, with 1 added to its denominator, or one failure
            would forbid a transition on all targets); "local": it tells of targets within 25 mm alone.
    """

    def __init__(self, states: int, actions: int, scale: float, kind: Literal["spread", "local"] = "spread") -> None:
        self._shape = states, actions
        self._histories = Histories(states * actions, scale, NEAR if kind == "local" else np.inf)

    def add(self, state: int, action: int, target: Array, reward: float) -> None:
        """Append the reward of a transition made while a target (3,) m was presented."""
        self._histories.add(state * self._shape[1] + action, target, reward)

    def rewards(self, target: Array) -> Array:
        """The expected reward of each transition, shape (S, A), at most 0."""
        return self._histories.average(target, 0.0).reshape(self._shape)

    def copy(self) -> Failures:
        """One that goes its own way from here."""
        other = object.__new__(Failures)
        other._shape, other._histories = self._shape, self._histories.copy()
        return other


def has_failed(values: Array, state: int, following: int) -> bool:
    """Whether a transition did not climb the values (S,) of the plan that it was part of (thesis 8.1)."""
    return bool(values[following] <= values[state])


def failures_of(space: Space, reaches: Reaches, kind: str) -> Failures | AlikeFailures:
    """What remembers failures in that way: "spread", "local", see `Failures`, or "alike", see `AlikeFailures`.

    Raises UnknownName if there is no such way.
    """
    if kind not in FAILURES:
        raise UnknownName("way to remember failures", kind, FAILURES)
    if kind == "alike":
        return AlikeFailures(space, reaches)
    return Failures(len(space), space.goals.shape[1], reaches.scale, "local" if kind == "local" else "spread")
