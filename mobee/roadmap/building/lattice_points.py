"""Regular points of a task space at a given spacing."""

from __future__ import annotations

from itertools import product

import numpy as np

from mobee.arrays import Array, Ints

Point = tuple[int, ...]  # numbers of half edges from the origin: where all are even, a point of the lattice, else one between
APART = 0.8  # spacings: nearer to each other are no two points
_MOST = 3  # dimensions in which points between are used; in more they are too many
_ROUNDING = 1e-9  # spacings


class LatticePoints:
    """The points of a box (m, 2) whose nearest neighbours are a spacing (m,) away; the middle of the box is one of them.

    Points between fill what the lattice leaves at the border of what can be reached.
    """

    def __init__(self, box: Array, spacing: Array) -> None:
        self._spacing = spacing
        self._origin = box.mean(axis=1)
        self._width = 0.5 * (box[:, 1] - box[:, 0]) / spacing + _ROUNDING
        self._edges = 0.5 * _edges(len(spacing))
        ways = _ways(len(spacing))
        far = np.linalg.norm(ways @ self._edges, axis=1)
        self._beside = ways[far < 1.0 + _ROUNDING]
        self._halves = ways[far < 0.5 + _ROUNDING]
        self._close = [tuple(way) for way in ways[far < APART].tolist()]

    def y(self, points: Ints) -> Array:
        """Where points (N, m) are, (N, m) in the units of the task."""
        found: Array = self._origin + (points @ self._edges) * self._spacing
        return found

    def around(self, points: Ints) -> list[list[Point]]:
        """The lattice's points in the box that are not further from points (N, m) than a spacing."""
        return self._moved(points, self._beside, even=True)

    def between(self, points: Ints) -> list[list[Point]]:
        """The points in the box that are half a spacing from lattice points (N, m)."""
        return self._moved(points, self._halves, even=False)

    def close(self, point: Point) -> list[Point]:
        """The points that are too near to a point for both to be taken."""
        return [tuple(a + b for a, b in zip(point, way, strict=True)) for way in self._close]

    def nearest(self, y: Array) -> Ints:
        """About the nearest points of the lattice in the box to task points (N, m), (N, m)."""
        away = np.clip((y - self._origin) / self._spacing, -self._width, self._width)
        edges = 0.5 * away @ np.linalg.inv(self._edges)
        whole, inward = (2 * rounded.astype(np.intp)[:, None] for rounded in (np.rint(edges), np.trunc(edges)))
        even = self._beside[(self._beside % 2 == 0).all(axis=1)]
        beside = np.concatenate([np.zeros_like(whole), whole, whole + even, inward], axis=1)  # of these the origin is always in the box
        there = beside @ self._edges
        far = ((there - away[:, None]) ** 2).sum(axis=2)
        far[(np.abs(there) > self._width).any(axis=2)] = np.inf
        found: Ints = beside[np.arange(len(y)), far.argmin(axis=1)]
        return found

    def _moved(self, points: Ints, ways: Ints, even: bool) -> list[list[Point]]:
        beside = points[:, None] + ways
        bad = (np.abs(beside @ self._edges) > self._width).sum(axis=2)
        if even:
            bad += (beside % 2).sum(axis=2)
        return [[tuple(one) for one in near[wrong == 0].tolist()] for near, wrong in zip(beside, bad, strict=True)]


def _edges(dimensions: int) -> Array:
    """Those of the lattice (m, m), a row each, all of length 1: hexagonal in 2-D, face-centred cubic in 3-D, else cubic.

    The first two leave the smallest holes for their number of points.
    """
    if dimensions == 2:
        return np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]])
    if dimensions == 3:
        side = np.sqrt(0.5)
        return np.array([[side, side, 0.0], [side, 0.0, side], [0.0, side, side]])
    return np.eye(dimensions)


def _ways(dimensions: int) -> Ints:
    """From a point to those up to an edge away, and some more, in half edges; those of the lattice alone in many dimensions."""
    if dimensions > _MOST:
        return np.concatenate([2 * np.eye(dimensions, dtype=np.intp), -2 * np.eye(dimensions, dtype=np.intp)])
    return np.array([way for way in product(range(-2, 3), repeat=dimensions) if any(way)])
