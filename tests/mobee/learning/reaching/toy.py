# SPDX-License-Identifier: Apache-2.0
"""A toy world to reach in: hands at places that follow from the state, and targets that block some transitions."""

from __future__ import annotations

import numpy as np

from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.tabular import ReachTable, ideal
from mobee.reach import ReachTarget
from tests.mobee.learning.toys import arm

SPACE = arm()
HANDS = np.random.default_rng(1).random((81, 3)) * [0.3, 0.4, 0.4] + [-0.4, 0.0, 0.0]
PLACES = np.array([[x, y, z] for x in (-0.4, -0.25, -0.1) for y in (0.0, 0.2, 0.4) for z in (0.0, 0.2, 0.4)])
TARGETS = [ReachTarget(place) for place in PLACES]
BLOCKED = 0.9 * (np.random.default_rng(2).random((27, 81, 16)) < 0.18)


def world(target):
    nearest = int(np.linalg.norm(PLACES - target, axis=1).argmin())
    return np.maximum(np.linalg.norm(HANDS - target, axis=1) - 0.12, 0.0) + 0.005, BLOCKED[nearest]


def plant(seed=0, noise=0.005, **options) -> ReachTable:
    return ReachTable(SPACE, *ideal(SPACE), world, noise, seed, **options)


def agent(seed=0, on=None, **options) -> ReachAgent:
    return ReachAgent(SPACE, plant(seed) if on is None else on, marker="hand", hands=HANDS, seed=seed, **options)
