# SPDX-License-Identifier: Apache-2.0
"""An oracle that knows no formula of the engine: support points of solids, and the overlap of two along one direction."""

from __future__ import annotations

from dataclasses import dataclass

import coal
import numpy as np

from mobee._core.narrow import Volumes, distances, overlaps
from mobee.model.kinematics import matrix_from_quaternion


@dataclass
class Solid:
    kind: str
    half: np.ndarray  # (radius,), (radius, half height), half edges (3,), or vertices (v, 3)
    position: np.ndarray
    rotation: np.ndarray

    def moved(self, shift=(0.0, 0.0, 0.0), turn=None) -> Solid:
        """Moved, after having been turned about the root's origin."""
        turn = np.eye(3) if turn is None else turn
        return Solid(self.kind, self.half, turn @ self.position + shift, turn @ self.rotation)


def solid(kind, half, position=(0.0, 0.0, 0.0), rotation=None) -> Solid:
    return Solid(kind, np.array(half, float), np.array(position, float), np.eye(3) if rotation is None else rotation)


def random_turn(rng) -> np.ndarray:
    return matrix_from_quaternion(rng.normal(size=4))


def random_solid(rng, kind, spread=0.1, size=1.0) -> Solid:
    """Arm-sized times `size`, turned anyhow, its centre within +-spread m on each axis."""
    if kind == "box":
        half = rng.uniform(0.02, 0.15, 3)
    elif kind == "convex":
        half = rng.normal(size=(rng.integers(4, 20), 3)) * rng.uniform(0.02, 0.1, 3)
    else:
        half = np.array([rng.uniform(0.02, 0.08), rng.uniform(0.025, 0.15)][: 1 if kind == "sphere" else 2])
    return solid(kind, half * size, rng.uniform(-spread, spread, 3), random_turn(rng))


@dataclass
class Found:
    depth: float
    normal: np.ndarray
    point: np.ndarray


def placed(items) -> Volumes:
    """Solids as the core reads them."""
    volumes = Volumes(len(items))
    for at, item in enumerate(items):
        volumes.place(at, item.kind, () if item.kind == "convex" else item.half, item.position, item.rotation)
        if item.kind == "convex":
            volumes.hull(at, item.half)
    return volumes


def overlap(a, b) -> Found:
    """The engine's answer."""
    (depth,), (touch,) = overlaps(placed([a]), placed([b]))
    return Found(float(depth), touch["normal"], touch["point"])


def distance(a, b) -> float:
    (apart,) = distances(placed([a]), placed([b]))
    return float(apart)


def farthest(item, directions) -> np.ndarray:
    """How far a solid reaches along unit directions (m, 3), measured from the root's origin: (m,) m."""
    local = directions @ item.rotation
    if item.kind == "box":
        reach = np.abs(local) @ item.half
    elif item.kind == "convex":
        reach = (local @ item.half.T).max(axis=1)
    else:
        side = np.hypot(local[:, 0], local[:, 1]) if item.kind == "cylinder" else 1.0
        height = item.half[1] if len(item.half) > 1 else 0.0
        reach = np.abs(local[:, 2]) * height + item.half[0] * side
    return reach + directions @ item.position


def overlap_along(a, b, directions) -> np.ndarray:
    """Return the distances (m,) in m that `a` must move along unit directions (m, 3) until a plane across it separates them."""
    return farthest(b, directions) + farthest(a, -directions)


def sampled_depth(a, b, rng) -> float:
    """The least such distance over many random directions, refined around the best few: never below the true depth."""
    first = rng.normal(size=(600, 3))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    depths = overlap_along(a, b, first)
    starts = np.argsort(depths)[:5]
    best, least, width = first[starts], depths[starts], 0.2
    for _ in range(24):
        tried = best[:, None] + width * rng.normal(size=(5, 40, 3))
        tried /= np.linalg.norm(tried, axis=2, keepdims=True)
        depths = overlap_along(a, b, tried.reshape(-1, 3)).reshape(5, 40)
        rows, at = np.arange(5), depths.argmin(axis=1)
        better = depths[rows, at] < least
        best[better], least[better] = tried[rows, at][better], depths[rows, at][better]
        width *= 0.6
    return float(least.min())


def coal_distance(a, b, tolerance=1e-6) -> float:
    """Positive: the distance by coal; else its penetration."""
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    request.gjk_tolerance, request.gjk_max_iterations = tolerance, 1000
    (one, at), (other, there) = _coal(a), _coal(b)
    return coal.distance(one, at, other, there, request, result)


def _coal(item):
    place = coal.Transform3s(item.rotation, item.position)
    if item.kind == "convex":
        points = coal.StdVec_Vec3s()
        for vertex in item.half:
            points.append(vertex)
        return coal.Convex.convexHull(points, True, None), place
    makers = {"sphere": coal.Sphere, "capsule": coal.Capsule, "cylinder": coal.Cylinder, "box": coal.Box}
    size = item.half * (2.0 if item.kind == "box" else 1.0)
    return makers[item.kind](*(size if item.kind == "box" else [size[0], *(2.0 * size[1:])])), place
