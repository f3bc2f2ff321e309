"""An oracle that knows no formula of the library: support points, and the overlap of two volumes along one direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.collision.closed_form import Overlaps
from mobee.collision.narrow import overlaps
from mobee.collision.volumes import place, volumes
from mobee.kinematics.quaternion import to_matrix
from mobee.robot.robot import Array

KINDS = ("sphere", "capsule", "cylinder", "box")


@dataclass
class Solid:
    kind: str
    size: tuple[float, ...]
    position: Array
    rotation: Array


def solid(kind, size, position=(0.0, 0.0, 0.0), rotation=None) -> Solid:
    return Solid(kind, size, np.array(position, dtype=float), np.eye(3) if rotation is None else rotation)


def random_solid(rng: np.random.Generator, kind: str, spread: float = 0.1) -> Solid:
    """Arm-sized, turned anyhow, its centre within +-spread m on each axis."""
    if kind == "box":
        size = tuple(rng.uniform(0.04, 0.3, 3))
    else:
        size = (rng.uniform(0.02, 0.08), rng.uniform(0.05, 0.3))[: 1 if kind == "sphere" else 2]
    return solid(kind, size, rng.uniform(-spread, spread, 3), to_matrix(rng.normal(size=4)))


def overlap(a: Solid, b: Solid) -> Overlaps:
    """The library's answer for one pair."""
    placed = place(volumes([a, b], [0, 0]), np.eye(4)[None])
    return overlaps(placed, np.array([0]), np.array([1]))


def farthest(item: Solid, directions: Array) -> Array:
    """How far the volume reaches along unit directions (m, 3), measured from the root's origin: (m,) m."""
    local = directions @ item.rotation
    if item.kind == "sphere":
        reach = np.full(len(local), item.size[0])
    elif item.kind == "box":
        reach = np.abs(local) @ (np.array(item.size) / 2)
    else:
        radius, height = item.size
        side = np.hypot(local[:, 0], local[:, 1]) if item.kind == "cylinder" else 1.0
        reach = np.abs(local[:, 2]) * height / 2 + radius * side
    return reach + directions @ item.position


def overlap_along(a: Solid, b: Solid, directions: Array) -> Array:
    """How far `a` must move along each unit direction (m, 3) until a plane across it separates the two: (m,) m."""
    return farthest(b, directions) + farthest(a, -directions)


def sampled_depth(a: Solid, b: Solid, rng: np.random.Generator) -> float:
    """The smallest such way over many random directions, refined around the best: never below the true depth."""
    directions = rng.normal(size=(2000, 3))
    width = 1.0
    for _ in range(12):
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        ways = overlap_along(a, b, directions)
        best = directions[ways.argmin()]
        width *= 0.5
        directions = np.vstack([best, best + width * rng.normal(size=(400, 3))])
    return float(ways.min())
