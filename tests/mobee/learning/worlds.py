# SPDX-License-Identifier: Apache-2.0
"""Worlds from the literature on exploration, as plants: hard for whoever does not plan to explore."""

from __future__ import annotations

import numpy as np

from mobee.learning import tabular
from mobee.learning.space import Space
from mobee.learning.tabular import TabularPlant
from tests.mobee.learning.toys import toy_robot


def space_of(goals) -> Space:
    """A space whose actions aim at these states, (S, A), -1 for no action."""
    low, high = np.deg2rad(15.5), np.deg2rad(106)
    return Space(toy_robot(), ["l_elbow"], np.linspace(low, high, len(goals))[:, None], goals)


def river_swim(length: int, seed: int = 0) -> TabularPlant:
    """RiverSwim with the goals that the actions mean: left and right; at the ends an action may aim at the state itself."""
    world = tabular.river_swim(length)
    return TabularPlant(space_of(world.outcomes[:, [0, 1], [0, 2]]), world.outcomes, world.probabilities, seed)


def deep_sea(depth: int, seed: int = 0) -> TabularPlant:
    """DeepSea with the goals that the actions mean."""
    world = tabular.deep_sea(depth)
    return TabularPlant(space_of(world.outcomes[:, :, 0]), world.outcomes, world.probabilities, seed)
