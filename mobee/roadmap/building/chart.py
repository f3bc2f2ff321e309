"""The explored part of a task space: vertices, expansion weights, covered region."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from mobee.arrays import Array, Ints


class Rows:
    """Rows of one shape; `all` is a view of those there are."""

    def __init__(self, shape: tuple[int, ...], dtype: DTypeLike = np.float64) -> None:
        self._room: NDArray[Any] = np.empty((64, *shape), dtype=dtype)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def all(self) -> NDArray[Any]:
        """The rows (N, ...), to be read and written; not to be kept over an `append`."""
        return self._room[: self._count]

    def append(self, row: object) -> None:
        """Add a row at the end."""
        if self._count == len(self._room):
            self._room = np.concatenate([self._room, np.empty_like(self._room)])
        self._room[self._count] = row
        self._count += 1


COUNT = {1: 2, 2: 24, 3: 64}  # of a task space of so many dimensions; more dimensions: 128
_MOST = 128


def directions(dimensions: int) -> Array:
    """Unit vectors (D, dimensions): both in 1-D, a circle in 2-D, a spiral over the sphere in 3-D, drawn and opposite ones beyond."""
    count = COUNT.get(dimensions, _MOST)
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


Flags = NDArray[np.bool_]

FLAT = 0.05  # |det| of the edges, in spacings: flatter simplices cover nothing
REACH = 2.0  # spacings from a simplex's origin within which all of it lies
_EDGE = 1e-9  # barycentric: what lies on the border is inside


class Region:
    """Simplices in units of the spacing, each an origin and the inverse of its edges."""

    def __init__(self, dimensions: int) -> None:
        self._origins = Rows((dimensions,))
        self._inverses = Rows((dimensions, dimensions))

    def __len__(self) -> int:
        return len(self._origins)

    def add(self, corners: Array) -> Array | None:
        """Cover the simplex of corners (m + 1, m), the first its origin; its inverse (m, m), None where it is flat and nothing is added."""
        edges = (corners[1:] - corners[0]).T
        if abs(np.linalg.det(edges)) < FLAT:
            return None
        inverse: Array = np.linalg.inv(edges)
        self._origins.append(corners[0])
        self._inverses.append(inverse)
        return inverse

    def covers(self, places: Array) -> Flags:
        """Which of the places (N, m), near to each other, are inside some simplex, (N,) bool."""
        covered: Flags = np.zeros(len(places), dtype=bool)
        if not len(self._origins) or not len(places):
            return covered
        low, high = places.min(axis=0) - REACH, places.max(axis=0) + REACH
        origins = self._origins.all
        near = np.flatnonzero(((origins >= low) & (origins <= high)).all(axis=1))
        if len(near):
            covered |= inside(places[:, None], origins[near], self._inverses.all[near]).any(axis=1)
        return covered


def inside(places: Array, origins: Array, inverses: Array) -> Flags:
    """Whether places (..., m) lie in simplices of origins (..., m) and inverse edges (..., m, m), by their barycentric coordinates."""
    weights = np.einsum("...ij,...j->...i", inverses, places - origins)
    found: Flags = (weights >= -_EDGE).all(axis=-1) & (weights.sum(axis=-1) <= 1.0 + _EDGE)
    return found


NEAREST = 0.8  # spacings: no two vertices are nearer
FIRST, OTHERS = 1.25, 1.5  # no new vertex is further from its nearest, and from its n nearest


class Chart:
    """V, E, R and the expansion weights of thesis Algorithm 4.

    A direction of a vertex is free where the place one spacing away is inside the box, keeps its distance to all vertices and is not
    covered.  What is free is kept for all vertices and told anew where one is added, so that nothing is searched that cannot be found.
    """

    def __init__(self, low: Array, high: Array) -> None:
        self.low, self.high = low, high
        self.dimensions = len(low)
        self.ways = directions(self.dimensions)
        self.region = Region(self.dimensions)
        self._places = Rows((self.dimensions,))
        self._weights = Rows(())
        self._free = Rows((len(self.ways),), bool)
        self._edges = Rows((2,), np.int64)

    def __len__(self) -> int:
        return len(self._places)

    @property
    def places(self) -> Array:
        """(V, m)."""
        return self._places.all

    @property
    def weights(self) -> Array:
        """Expansion weights (V,), to be lowered where a search fails."""
        return self._weights.all

    @property
    def free(self) -> Flags:
        """(V, D), of `ways`."""
        return self._free.all

    @property
    def edges(self) -> Ints:
        """(E, 2): every vertex and its n nearest of when it was added (Algorithm 4)."""
        found: Ints = self._edges.all
        return found

    def nearest(self, place: Array, count: int) -> tuple[Ints, Array]:
        """The vertices nearest to a place (m,), at most so many, and how far they are; nearest first (Algorithm 2)."""
        squares = ((self.places - place) ** 2).sum(axis=1)
        some = np.argpartition(squares, count - 1)[:count] if count < len(squares) else np.arange(len(squares))
        order = some[np.lexsort((some, squares[some]))]
        return order, np.sqrt(squares[order])

    def accepts(self, place: Array) -> bool:
        """Whether a vertex at this place (m,) would keep its distance to all others, be near enough to n of them, and not be covered."""
        if not ((place >= self.low).all() and (place <= self.high).all()):
            return False
        if not len(self):
            return True
        _, apart = self.nearest(place, self.dimensions)
        return bool(NEAREST <= apart[0] <= FIRST and apart[-1] <= OTHERS and not self.region.covers(place[None])[0])

    def add(self, place: Array) -> Array | None:
        """Add a vertex (m,), its edges, and the simplex of it and its n nearest; this one's inverse edges, None where there is none."""
        number, n = len(self), self.dimensions
        corners, _ = self.nearest(place, n)
        simplex = self.region.add(np.concatenate([place[None], self.places[corners]])) if len(corners) == n else None
        self._close(place, simplex)
        self._places.append(place)
        self._weights.append(1.0)
        self._free.append(self._free_around(place))
        for corner in corners:
            self._edges.append((corner, number))
        return simplex

    def _free_around(self, place: Array) -> Flags:
        aims = place + self.ways
        free: Flags = np.all((aims >= self.low) & (aims <= self.high), axis=1)
        near = self.places[((self.places - place) ** 2).sum(axis=1) < (1.0 + NEAREST) ** 2]
        free &= (((aims[:, None] - near) ** 2).sum(axis=-1) >= NEAREST**2).all(axis=1)
        if free.any():
            free[free] = ~self.region.covers(aims[free])
        return free

    def _close(self, place: Array, simplex: Array | None) -> None:
        """What a new vertex takes from the others."""
        near = np.flatnonzero((((self.places - place) ** 2).sum(axis=1) < (1.0 + OTHERS) ** 2) & self.free.any(axis=1))
        aims = self.places[near][:, None] + self.ways
        taken = ((aims - place) ** 2).sum(axis=-1) < NEAREST**2
        if simplex is not None:
            taken |= inside(aims, place, simplex)
        self.free[near] &= ~taken
