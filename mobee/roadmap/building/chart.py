"""What a growing map knows of its task space, in units of the spacing: vertices, expansion weights, what is free around them."""

from __future__ import annotations

import numpy as np

from mobee.roadmap.building.directions import directions
from mobee.roadmap.building.region import Flags, Region, inside
from mobee.roadmap.building.rows import Rows
from mobee.robot.robot import Array, Ints

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
