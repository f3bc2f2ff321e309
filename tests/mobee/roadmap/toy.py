# SPDX-License-Identifier: Apache-2.0
"""A task that costs nothing to judge: the tip of a planar arm of three links of 1/3, its last link kept level within a tolerance."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mobee.roadmap.building.frontier_builder import EvaluatedPoses

LIMITS = np.array([[-1.5, 1.5], [0.1, 2.5], [-2.0, 2.0]])


@dataclass
class Arm:
    """The part of a Problem that a FrontierBuilder uses."""

    limits: np.ndarray = field(default_factory=LIMITS.copy)
    start: np.ndarray = field(default_factory=lambda: np.array([0.0, 1.0, -1.0]))
    evaluations: int = 0

    def __post_init__(self) -> None:
        self.free = np.arange(len(self.limits))

    def whole(self, samples: np.ndarray) -> np.ndarray:
        return samples.copy()


class Level:
    """Evaluates its poses: the last link must be level within 0.1 rad; y is the position of the tip."""

    def __init__(self, spacing: float, low: tuple[float, float] = (0.2, -0.4), high: tuple[float, float] = (0.9, 0.4)) -> None:
        self.problem = Arm()
        self.spacing = np.full(2, spacing)
        self.low, self.high = np.array(low) / spacing, np.array(high) / spacing

    def evaluate(self, q: np.ndarray) -> EvaluatedPoses:
        self.problem.evaluations += len(q)
        angles = np.cumsum(q, axis=1)
        tip = np.stack([np.cos(angles).sum(axis=1), np.sin(angles).sum(axis=1)], axis=1) / 3.0 / self.spacing
        level = np.abs(angles[:, -1]) / 0.1
        outside = np.maximum(0.0, np.maximum(self.low - tip, tip - self.high))
        return EvaluatedPoses(level**2 + ((outside / 0.25) ** 2).sum(axis=1), (level <= 1.0) & (outside == 0.0).all(axis=1), tip)

    def violations(self, q: np.ndarray) -> str:
        return "level"

    def reachable(self, count: int = 40) -> np.ndarray:
        """Places (N, m) in spacings that it reaches exactly level: the wrist by the cosine rule."""
        places = np.stack(np.meshgrid(*(np.linspace(a, b, count) for a, b in zip(self.low, self.high, strict=True))), axis=-1).reshape(
            -1, 2
        )
        wrist = places * self.spacing * 3.0 - [1.0, 0.0]
        square = (wrist**2).sum(axis=1)
        with np.errstate(invalid="ignore"):
            elbow = np.arccos((square - 2.0) / 2.0)
        shoulder = np.arctan2(wrist[:, 1], wrist[:, 0]) - elbow / 2.0
        q = np.stack([shoulder, elbow, -shoulder - elbow], axis=1)
        return places[((q >= LIMITS[:, 0]) & (q <= LIMITS[:, 1])).all(axis=1)]
