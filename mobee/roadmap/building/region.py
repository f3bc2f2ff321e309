"""The covered region of a task space: a union of simplices (R of thesis Algorithm 4)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mobee.roadmap.building.rows import Rows
from mobee.robot.robot import Array

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
