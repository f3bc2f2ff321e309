"""Rewards expected from nothing but how far the hand is from the target."""

from __future__ import annotations

import numpy as np

from mobee.learning.reaching.predictors.predictor import Reaches
from mobee.learning.reaching.predictors.reached import Reached, around
from mobee.robot.robot import Array

KNOTS = np.linspace(0.0, 0.6, 13)  # m
BOND = 2.0  # how much a knot holds to its neighbours, in reaches
PULL = 0.1  # and to the average of all rewards


def lengths(reaches: Reaches, target: Array) -> Array:
    """From each state's hand to a target, shape (S,), or to targets (T, 3), shape (S, T), in m."""
    far: Array = np.sqrt(((target - reaches.hands.reshape(-1, *[1] * (target.ndim - 1), 3)) ** 2).sum(axis=-1))
    return far


class DistancePrior:
    """A line through knots, fitted to all reaches seen when it is made; flat beyond the last knot."""

    def __init__(self, reaches: Reaches, known: Reached) -> None:
        self._reaches = reaches
        middle, _ = around(known)
        weights = _shares(np.linalg.norm(known.places[known.target] - reaches.hands[known.state], axis=1))
        step = np.diff(np.eye(len(KNOTS)), axis=0)
        square = (weights.T * known.count) @ weights + BOND * step.T @ step + PULL * np.eye(len(KNOTS))
        self._values = np.linalg.solve(square, (weights.T * known.count) @ known.mean + PULL * middle)

    def mean(self, target: Array) -> Array:
        """Expected rewards, shape (S,), or (S, T) for targets (T, 3)."""
        far = lengths(self._reaches, target)
        expected: Array = np.interp(far, KNOTS, self._values)
        return expected


def _shares(far: Array) -> Array:
    """How much of each knot is in a distance, shape (n, knots)."""
    shares: Array = np.stack([np.interp(far, KNOTS, one) for one in np.eye(len(KNOTS))], axis=-1).reshape(-1, len(KNOTS))
    return shares
