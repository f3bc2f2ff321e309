# SPDX-License-Identifier: Apache-2.0
"""Thesis Algorithms 3 and 4 as printed, over a plane, q = y, to see their results; each interpretation in the docs is a switch."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from mobee import minimize
from mobee.roadmap.building.frontier import SimplexRegion

D = 1.0


@dataclass
class Printed:
    """What happened: places of the vertices, where searches began, and whether the loop ended."""

    places: list[np.ndarray] = field(default_factory=list)
    began: list[int] = field(default_factory=list)
    ended: bool = False


def vector(y: np.ndarray, near: np.ndarray) -> np.ndarray:
    """|(y - y') - d| as printed: d taken from every coordinate."""
    return np.asarray(np.linalg.norm(y - near - D, axis=-1))


def scalar(y: np.ndarray, near: np.ndarray) -> np.ndarray:
    """| |y - y'| - d |."""
    return np.asarray(np.abs(np.linalg.norm(y - near, axis=-1) - D))


def run(
    repulsion: Callable[[np.ndarray, np.ndarray], np.ndarray],
    weight_kept: bool,
    separated: bool,
    half_width: float,
    loops: int,
    delta: float = 0.5,
    evaluations: int = 120,
) -> Printed:
    """At most so many loops from the middle of a box."""
    done, weights, region, start, weight = Printed(), [], SimplexRegion(2), -1, 1.0
    for loop in range(loops):
        if not weight > 0.0:
            done.ended = True
            return done
        mean = np.zeros(2) if start < 0 else done.places[start]
        done.began.append(start)

        def cost(y: np.ndarray) -> np.ndarray:
            total = 10.0 * np.maximum(0.0, np.abs(y) - half_width).sum(axis=1)
            if done.places:
                known = np.array(done.places)
                apart = np.linalg.norm(y[:, None] - known, axis=-1)
                for near in np.argsort(apart, axis=1)[:, :2].T:
                    total += repulsion(y, known[near])
            return np.asarray(total)

        y = minimize(cost, mean, 0.2, evaluations=evaluations, seed=loop).x
        valid = bool((np.abs(y) <= half_width).all()) and not region.covers(y[None])[0]
        if separated and done.places:
            apart = np.sort(np.linalg.norm(np.array(done.places) - y, axis=1))
            valid = valid and 0.8 * D <= apart[0] <= 1.25 * D and apart[min(1, len(apart) - 1)] <= 1.5 * D
        if valid:
            nearest = sorted(done.places, key=lambda place: float(np.linalg.norm(place - y)))[:2]
            if len(nearest) == 2:
                region.add(np.array([y, *nearest]))
            done.places.append(y)
            weights.append(1.0)
        elif weight_kept and start >= 0:
            weights[start] -= delta
        if not weights:
            continue
        start = int(np.argmax(weights))
        weight = weights[start]
    return done
