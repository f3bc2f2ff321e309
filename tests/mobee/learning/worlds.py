# SPDX-License-Identifier: Apache-2.0
"""Worlds from the literature on exploration, as tables: hard for whoever does not plan to explore."""

from __future__ import annotations

import numpy as np

from mobee.learning.space import Space
from mobee.learning.tabular import TabularPlant
from tests.mobee.learning.toys import toy_robot


def space_of(goals) -> Space:
    """A space whose actions aim at these states, (S, A), -1 for no action."""
    low, high = np.deg2rad(15.5), np.deg2rad(106)
    return Space(toy_robot(), ["l_elbow"], np.linspace(low, high, len(goals))[:, None], goals)


def river_swim(length: int, seed: int = 0) -> TabularPlant:
    """A row of states and a current to the left (Strehl and Littman 2008): left always succeeds, right mostly does not.

    `length` states with two actions each, left (0) and right (1); at the ends an action may aim at the state itself.
    """
    states = np.arange(length)
    left, right = np.maximum(states - 1, 0), np.minimum(states + 1, length - 1)
    outcomes = np.stack([np.stack([left, left, left], axis=1), np.stack([left, states, right], axis=1)], axis=1)
    probabilities = np.tile([[1.0, 0.0, 0.0], [0.05, 0.6, 0.35]], (length, 1, 1))
    probabilities[0, 1] = 0.0, 0.4, 0.6
    probabilities[-1, 1] = 0.4, 0.0, 0.6
    return TabularPlant(space_of(np.stack([left, right], axis=1)), outcomes, probabilities, seed)


def deep_sea(depth: int, seed: int = 0) -> TabularPlant:
    """A triangle in which each action dives a row, to the left or to the right; after the last row one is at the top (Osband 2019).

    State r (r + 1) / 2 + c in row r and column c <= r; certain outcomes.
    """
    goals = []
    for row in range(depth):
        below = (row + 1) * (row + 2) // 2
        goals += [[0, 0] if row == depth - 1 else [below + max(column - 1, 0), below + column + 1] for column in range(row + 1)]
    outcomes = np.array(goals)[:, :, None]
    return TabularPlant(space_of(goals), outcomes, np.ones(outcomes.shape), seed)
