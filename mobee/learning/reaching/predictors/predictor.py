# SPDX-License-Identifier: Apache-2.0
"""The interface of predictors of rewards, and a prior mean from the distance between hand and target."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import numpy as np

from mobee.arrays import Array
from mobee.learning.reaching.predictors.observed import Reached, around
from mobee.learning.reaching.reaches import Reaches


@runtime_checkable
class RewardPredictor(Protocol):
    """The interface of predictors: predicts the reward of a reach from each of S states for any target.

    Predictions must depend only on the settings and the sequence of calls of `add`, so that they can be rebuilt from a record; all other
    methods change nothing. Targets are positions (3,) m, root frame; there may be any number of different ones.
    """

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn from the reward of a reach that began in `state`, for a target (3,) m.

        `expected`: the reward that `mean` predicted just before.
        """
        ...

    def mean(self, target: Array) -> Array:
        """Return the expected reward of a reach from each state for a target (3,) m, shape (S,)."""
        ...

    def deviation(self, target: Array) -> Array:
        """Return the standard deviation of the expected reward of a reach from each state for a target (3,) m, shape (S,).

        Raises InvalidValue if the predictor has no deviations.
        """
        ...

    def sample(self, target: Array, rng: np.random.Generator) -> Array:
        """Return a random sample, from the predictor's distribution, of the mean reward of a reach from each state, shape (S,).

        `target`: (3,) m. Raises InvalidValue if the predictor has no distribution.
        """
        ...

    @property
    def settings(self) -> dict[str, Any]:
        """The name of the predictor and the settings that determine its predictions, as JSON values."""
        ...


@runtime_checkable
class WorldComparer(Protocol):
    """Additional interface of a predictor that estimates to what degree rewards from another world are valid in the present one.

    Worlds differ in their objects, such as obstacles, or in the robot.
    """

    def begin_world(self) -> None:
        """Predict from now on for another world or another robot, in which all later reaches are made."""
        ...


def begin_world(predictor: RewardPredictor) -> None:
    """Report to a predictor that all later reaches are made in another world, or on another robot.

    A predictor that is not a `WorldComparer` treats all rewards as rewards of one world.
    """
    if isinstance(predictor, WorldComparer):
        predictor.begin_world()


KNOTS = np.linspace(0.0, 0.6, 13)  # m, distances between hand and target
SMOOTHNESS = 2.0  # weight of equal values at neighbouring knots, in reaches
SHRINKAGE = 0.1  # weight of the average of all rewards at each knot, in reaches


def lengths(reaches: Reaches, target: Array) -> Array:
    """Return the distance [m] between the hand in each state and a target (3,) m, root frame, shape (S,); for targets (T, 3), (S, T)."""
    far: Array = np.sqrt(((target - reaches.hands.reshape(-1, *[1] * (target.ndim - 1), 3)) ** 2).sum(axis=-1))
    return far


class DistancePrior:
    """The expected reward as a function of the distance between hand and target, fitted to all reaches that were observed (`known`).

    It is linear between KNOTS (every 5 cm up to 0.6 m), and constant beyond the last of them.
    """

    def __init__(self, reaches: Reaches, known: Reached) -> None:
        self._reaches = reaches
        middle, _ = around(known)
        weights = _shares(np.linalg.norm(known.places[known.target] - reaches.hands[known.state], axis=1))
        step = np.diff(np.eye(len(KNOTS)), axis=0)
        square = (weights.T * known.count) @ weights + SMOOTHNESS * step.T @ step + SHRINKAGE * np.eye(len(KNOTS))
        self._values = np.linalg.solve(square, (weights.T * known.count) @ known.mean + SHRINKAGE * middle)

    def mean(self, target: Array) -> Array:
        """Return the expected rewards of reaches from each state for a target (3,) m, shape (S,), or for targets (T, 3), shape (S, T)."""
        far = lengths(self._reaches, target)
        expected: Array = np.interp(far, KNOTS, self._values)
        return expected


def _shares(far: Array) -> Array:
    """Return the interpolation weights of the knots at each distance, shape (n, knots)."""
    shares: Array = np.stack([np.interp(far, KNOTS, one) for one in np.eye(len(KNOTS))], axis=-1).reshape(-1, len(KNOTS))
    return shares
