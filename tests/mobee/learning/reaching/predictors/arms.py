# SPDX-License-Identifier: Apache-2.0
"""Reach actions and reaches drawn at random, and a reward that depends on both pose and target."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.learning.reaching.predictors import Reaches, RewardPredictor

STATES, TARGETS = 12, 6
FAR = np.array([50.0, -40.0, 60.0])  # m: from where nothing is alike


def reaches(seed: int = 0, states: int = STATES) -> Reaches:
    rng = np.random.default_rng(seed)
    return Reaches(rng.uniform(-1.0, 1.0, (states, 4)), rng.uniform(-0.2, 0.2, (states, 3)))


def places(seed: int = 0, targets: int = TARGETS) -> Array:
    return np.random.default_rng([seed, 1]).uniform(-0.25, 0.25, (targets, 3))


def reward(made: Reaches, state: int, target: Array) -> float:
    """From 0 to 1, smooth in pose and target."""
    way = target - made.hands[state]
    return float(np.exp(-0.5 * way @ way / 0.15**2) * (0.6 + 0.4 * np.sin(2.0 * made.samples[state, 0])))


def drawn(made: Reaches, tries: int, seed: int = 0, targets: int = TARGETS, noise: float = 0.02) -> list[tuple[int, Array, float]]:
    """Reaches: state, target, reward; some of them repeats."""
    rng, where = np.random.default_rng([seed, 2]), places(seed, targets)
    found = []
    for _ in range(tries):
        state, target = int(rng.integers(len(made))), where[rng.integers(targets)]
        found.append((state, target, reward(made, state, target) + noise * rng.standard_normal()))
    return found


def taught(predictor: RewardPredictor, seen: list[tuple[int, Array, float]]) -> RewardPredictor:
    for state, target, value in seen:
        predictor.add(state, target, value, 0.0)
    return predictor
