# SPDX-License-Identifier: Apache-2.0
"""Small decision problems given by their tables."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class Table:
    """A model given by its tables, (S, A, B) each."""

    outcomes: np.ndarray
    probabilities: np.ndarray


def chain():
    """Six states in a row, one action a state: on to the next; the last stays.  With rewards (6, 1)."""
    following = np.minimum(np.arange(6) + 1, 5)
    return Table(following[:, None, None], np.ones((6, 1, 1))), np.array([[-1.0]] * 5 + [[0.0]])


def random_problem(seed):
    """Model, reward and discount: empty bins anywhere, states and actions that do not exist, rewards of either sign."""
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, high) for high in (30, 8, 6))
    weights = rng.exponential(size=shape) * (rng.random(shape) < 0.7)
    weights[rng.random(shape[0]) < 0.1] = 0.0
    totals = weights.sum(axis=-1, keepdims=True)
    reward = rng.choice([0.01, 1.0, 100.0]) * rng.normal(loc=rng.choice([-2.0, 0.0, 2.0]), size=shape[:2])
    reward[rng.random(shape[:2]) < 0.1] = -np.inf
    model = Table(rng.integers(shape[0], size=shape), weights / np.where(totals > 0, totals, 1.0))
    return model, reward, float(rng.choice([0.0, 0.5, 0.9, 0.99]))
