# SPDX-License-Identifier: Apache-2.0
"""The explored part of a task space: vertices, their expansion weights, and the region covered by simplices (thesis Algorithm 4).

Searches for new vertices start first at vertices with large expansion weights. All points are task coordinates divided by the spacing of
the roadmap, so that neighbours are about 1 apart.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from mobee.arrays import Array, Ints

Flags = NDArray[np.bool_]


class GrowingArray:
    """An array to which rows can be appended; `shape`: the shape of one row."""

    def __init__(self, shape: tuple[int, ...], dtype: DTypeLike = np.float64) -> None:
        self._buffer: NDArray[Any] = np.empty((64, *shape), dtype=dtype)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def rows(self) -> NDArray[Any]:
        """A writable view (N, ...) of all rows; it is invalid after the next `append`."""
        return self._buffer[: self._count]

    def append(self, row: object) -> None:
        """Add a row at the end."""
        if self._count == len(self._buffer):
            self._buffer = np.concatenate([self._buffer, np.empty_like(self._buffer)])
        self._buffer[self._count] = row
        self._count += 1


DIRECTIONS = {1: 2, 2: 24, 3: 64}  # number of search directions, by the dimension of the task space
MANY_DIRECTIONS = 128  # in higher dimensions


def directions(dimensions: int) -> Array:
    """Return the unit vectors (D, m) in which a roadmap searches from each vertex, for a task space of m = `dimensions`.

    2 directions in 1-D, 24 on a circle in 2-D, 64 on a spiral over the sphere in 3-D, else 128 in random opposite pairs.
    """
    count = DIRECTIONS.get(dimensions, MANY_DIRECTIONS)
    if dimensions == 1:
        return np.array([[1.0], [-1.0]])
    if dimensions == 2:
        angle = 2.0 * math.pi * np.arange(count) / count
        return np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if dimensions == 3:
        height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
        turn = math.pi * (3.0 - math.sqrt(5.0)) * np.arange(count)
        radius = np.sqrt(1.0 - height**2)
        return np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
    drawn = np.random.default_rng(0).standard_normal((count // 2, dimensions))
    half: Array = drawn / np.sqrt((drawn**2).sum(axis=1, keepdims=True))
    return np.concatenate([half, -half])


MIN_DETERMINANT = 0.05  # of a simplex's edges, in spacings: flatter simplices cover nothing
SIMPLEX_EXTENT = 2.0  # spacings: a simplex lies within this distance of its origin
_BORDER = 1e-9  # barycentric: points on the border are inside


class SimplexRegion:
    """The region of a task space that is covered by simplices (R of thesis Algorithm 4).

    All points are task coordinates divided by the spacing of the roadmap, so corners of a simplex are about 1 apart. The region stores
    two arrays for each simplex: its first corner (called the origin), and the inverse of the matrix whose columns are the edges from this
    corner to the others. `dimensions`: m of the task space.
    """

    def __init__(self, dimensions: int) -> None:
        self._origins = GrowingArray((dimensions,))
        self._inverses = GrowingArray((dimensions, dimensions))

    def __len__(self) -> int:
        return len(self._origins)

    def add(self, corners: Array) -> Array | None:
        """Add the simplex with the corners `corners` (m + 1, m).

        Returns the inverse (m, m) of the matrix whose columns are the edges from the first corner to the others. Returns None, and
        adds nothing, if the simplex is nearly flat (its determinant, in spacings, is below MIN_DETERMINANT = 0.05).
        """
        edges = (corners[1:] - corners[0]).T
        if abs(np.linalg.det(edges)) < MIN_DETERMINANT:
            return None
        inverse: Array = np.linalg.inv(edges)
        self._origins.append(corners[0])
        self._inverses.append(inverse)
        return inverse

    def covers(self, points: Array) -> Flags:
        """Return whether each of the points (N, m) is inside a simplex of the region, (N,).

        The call is fast if the points are near each other, because then only few simplices are tested.
        """
        covered: Flags = np.zeros(len(points), dtype=bool)
        if not len(self._origins) or not len(points):
            return covered
        low, high = points.min(axis=0) - SIMPLEX_EXTENT, points.max(axis=0) + SIMPLEX_EXTENT
        origins = self._origins.rows
        near = np.flatnonzero(((origins >= low) & (origins <= high)).all(axis=1))
        if len(near):
            covered |= inside_simplex(points[:, None], origins[near], self._inverses.rows[near]).any(axis=1)
        return covered


def inside_simplex(points: Array, origins: Array, inverses: Array) -> Flags:
    """Return whether points (..., m) lie inside simplices, (...,).

    `origins` (..., m): first corners of the simplices. `inverses` (..., m, m): inverses of the matrices whose columns are the edges from
    these corners.
    """
    barycentric = np.einsum("...ij,...j->...i", inverses, points - origins)
    found: Flags = (barycentric >= -_BORDER).all(axis=-1) & (barycentric.sum(axis=-1) <= 1.0 + _BORDER)
    return found


MIN_DISTANCE = 0.8  # spacings: no two vertices are nearer to each other
MAX_NEAREST = 1.25  # spacings from a new vertex to the nearest one
MAX_NEIGHBOURS = 1.5  # spacings from a new vertex to the furthest of the n nearest ones, n the dimension


class Frontier:
    """Vertices V, edges E, covered region R and expansion weights of thesis Algorithm 4, in task coordinates divided by the spacing.

    R consists of simplices, each of a new vertex and the m vertices nearest to it. A direction at a vertex is free if the point one spacing
    away in this direction is inside the box, is at least MIN_DISTANCE (0.8 spacings) from all vertices, and is not in R. The free
    directions of all vertices are updated with each new vertex. `low`, `high`: (m,) corners of the task's box, in spacings. m is the
    dimension of the task space.
    """

    def __init__(self, low: Array, high: Array) -> None:
        self.low, self.high = low, high
        self.dimensions = len(low)
        self.directions = directions(self.dimensions)
        self.region = SimplexRegion(self.dimensions)
        self._points = GrowingArray((self.dimensions,))
        self._weights = GrowingArray(())
        self._free = GrowingArray((len(self.directions),), bool)
        self._edges = GrowingArray((2,), np.int64)

    def __len__(self) -> int:
        return len(self._points)

    @property
    def points(self) -> Array:
        """Points of the vertices, (V, m), in spacings."""
        return self._points.rows

    @property
    def weights(self) -> Array:
        """Expansion weights of the vertices, (V,), 1 at first.

        Searches start first at vertices with larger weights, and never at a weight of 0 or less. The array is a writable view: the caller
        lowers the weight of the start vertex after a failed search.
        """
        return self._weights.rows

    @property
    def free(self) -> Flags:
        """Whether each of the D `directions` is free at each vertex, (V, D): whether a search may aim at the point one spacing away."""
        return self._free.rows

    @property
    def edges(self) -> Ints:
        """Edges (E, 2), the older vertex first: each vertex is joined to the m vertices nearest to it when it was added (Algorithm 4)."""
        found: Ints = self._edges.rows
        return found

    def nearest(self, point: Array, count: int) -> tuple[Ints, Array]:
        """Return up to `count` vertices nearest to a point (m,), nearest first, and their distances in spacings (thesis Algorithm 2)."""
        squares = ((self.points - point) ** 2).sum(axis=1)
        some = np.argpartition(squares, count - 1)[:count] if count < len(squares) else np.arange(len(squares))
        order = some[np.lexsort((some, squares[some]))]
        return order, np.sqrt(squares[order])

    def accepts(self, point: Array) -> bool:
        """Return whether a vertex may be added at a point (m,).

        The point must be in the box and not covered by a simplex, at least 0.8 and at most 1.25 spacings from the nearest vertex, and at
        most 1.5 spacings from each of the m nearest vertices. The first point only has to be in the box.
        """
        if not ((point >= self.low).all() and (point <= self.high).all()):
            return False
        if not len(self):
            return True
        _, distances = self.nearest(point, self.dimensions)
        return bool(
            MIN_DISTANCE <= distances[0] <= MAX_NEAREST and distances[-1] <= MAX_NEIGHBOURS and not self.region.covers(point[None])[0]
        )

    def add(self, point: Array) -> Array | None:
        """Add a vertex at a point (m,), and its edges to the m nearest vertices.

        Also adds the simplex whose m + 1 corners are the new vertex and these m vertices to the region. Returns the inverse (m, m) of the
        matrix whose columns are the simplex's edges from the new vertex; None if there are fewer than m other vertices, or if the simplex
        is nearly flat (then it is not added).
        """
        number, n = len(self), self.dimensions
        corners, _ = self.nearest(point, n)
        simplex = self.region.add(np.concatenate([point[None], self.points[corners]])) if len(corners) == n else None
        self._close_directions(point, simplex)
        self._points.append(point)
        self._weights.append(1.0)
        self._free.append(self._free_directions(point))
        for corner in corners:
            self._edges.append((corner, number))
        return simplex

    def _free_directions(self, point: Array) -> Flags:
        targets = point + self.directions
        free: Flags = np.all((targets >= self.low) & (targets <= self.high), axis=1)
        near = self.points[((self.points - point) ** 2).sum(axis=1) < (1.0 + MIN_DISTANCE) ** 2]
        free &= (((targets[:, None] - near) ** 2).sum(axis=-1) >= MIN_DISTANCE**2).all(axis=1)
        if free.any():
            free[free] = ~self.region.covers(targets[free])
        return free

    def _close_directions(self, point: Array, simplex: Array | None) -> None:
        """Mark as not free the directions of other vertices that end near the new vertex at `point` (m,), or inside its simplex.

        A direction ends one spacing from its vertex. `simplex`: (m, m) inverse of the matrix of its edges; None if there is no simplex.
        """
        near = np.flatnonzero((((self.points - point) ** 2).sum(axis=1) < (1.0 + MAX_NEIGHBOURS) ** 2) & self.free.any(axis=1))
        targets = self.points[near][:, None] + self.directions
        taken = ((targets - point) ** 2).sum(axis=-1) < MIN_DISTANCE**2
        if simplex is not None:
            taken |= inside_simplex(targets, point, simplex)
        self.free[near] &= ~taken
