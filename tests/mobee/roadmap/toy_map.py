# SPDX-License-Identifier: Apache-2.0
"""A plant on which some motions fail, and small maps for it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mobee import AdaptiveRoadmap, Space, Voronoi
from mobee.plant import Outcome
from tests.mobee.planar import planar_arm

ROBOT = planar_arm()
JOINTS = ("m0", "m1", "m2")
SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])  # rad


class BlockedPlant:
    """A plant that moves to its target, or half as far if `blocked(q, target)` is true; every action takes a second."""

    def __init__(self, start: np.ndarray, blocked: Callable[[np.ndarray, np.ndarray], bool]) -> None:
        self.robot, self.blocked, self.q, self.acted = ROBOT, blocked, np.array(start, dtype=float), list[np.ndarray]()

    def measure(self, part: str) -> np.ndarray:
        return self.q.copy()

    def act(self, part: str, target: np.ndarray) -> Outcome:
        fails = self.blocked(self.q, target)
        self.q = 0.5 * (self.q + target) if fails else np.array(target, dtype=float)
        self.acted.append(np.array(target))
        return Outcome(self.q.copy(), True, 1.0, ("wall",) if fails else ())


def wall(first: np.ndarray, second: np.ndarray) -> Callable[[np.ndarray, np.ndarray], bool]:
    """The edge between two poses, in either direction."""
    pair = (np.array(first), np.array(second))

    def blocked(q: np.ndarray, target: np.ndarray) -> bool:
        return any(np.allclose(q, one) and np.allclose(target, other) for one, other in (pair, pair[::-1]))

    return blocked


def square(**options: object) -> AdaptiveRoadmap:
    """Corners 0, 1, 2, 3 in a ring, each joined to the next one and the one before."""
    goals = [[1, 3], [0, 2], [1, 3], [0, 2]]
    return AdaptiveRoadmap(Space(ROBOT, JOINTS, SQUARE, goals), **options)  # type: ignore[arg-type]  # options by name


def random_map(seed: int, vertices: int = 25, **options: object) -> AdaptiveRoadmap:
    """Random poses with 5 neighbours each, and 60 random observations."""
    found = AdaptiveRoadmap(Voronoi(ROBOT, JOINTS, vertices, seed, neighbours=5), **options)  # type: ignore[arg-type]  # likewise
    rng = np.random.default_rng(seed)
    for _ in range(60):
        state, action = int(rng.integers(vertices)), int(rng.integers(5))
        found.observe(state, action, found.space.goal(state, action) if rng.random() < 0.5 else state)
    return found
