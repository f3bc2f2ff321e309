"""What a flood knows of the points of its lattice: which are reached, which are still to be tried, which were missed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.roadmap.building.lattice_points import Point
from mobee.robot.robot import Array, Ints


@dataclass(slots=True, eq=False)
class Missed:
    """A point that was not reached so far: the least bad posture (n,), what is wrong with it, how often it is still to be tried."""

    q: Array
    wrong: float
    left: int


class FloodPoints:
    """Points by what is known of them.

    `vertex`: the number of a point's vertex.  `q`, `y`: of the vertices.  `untried`: points beside vertices, and of which of these the
    posture is still to be tried.  `missed`: those that were not reached so far.  `between`: points off the lattice that were or are to be
    tried.
    """

    def __init__(self, motors: int, coordinates: int) -> None:
        self._motors, self._coordinates = motors, coordinates
        self.vertex: dict[Point, int] = {}
        self.q: list[Array] = []
        self.y: list[Array] = []
        self.untried: dict[Point, list[int]] = {}
        self.missed: dict[Point, Missed] = {}
        self.between: set[Point] = set()

    def vertices(self) -> tuple[Ints, Array, Array]:
        """The points (V, m) of the vertices, their poses (V, n) rad and task points (V, m)."""
        q = np.array(self.q, dtype=np.float64).reshape(-1, self._motors)
        y = np.array(self.y, dtype=np.float64).reshape(-1, self._coordinates)
        return self._points(self.vertex), q, y

    def state(self) -> dict[str, NDArray[Any]]:
        """All of it as arrays."""
        points, q, y = self.vertices()
        missed = self.missed.values()
        return {
            "points": points,
            "q": q,
            "y": y,
            "untried": self._points(self.untried),
            "sources": np.array([source for sources in self.untried.values() for source in sources], dtype=np.intp),
            "counts": np.array([len(sources) for sources in self.untried.values()], dtype=np.intp),
            "missed": self._points(self.missed),
            "missed_q": np.array([one.q for one in missed]).reshape(-1, self._motors),
            "missed_wrong": np.array([one.wrong for one in missed], dtype=np.float64),
            "missed_left": np.array([one.left for one in missed], dtype=np.intp),
            "between": self._points(sorted(self.between)),
        }

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Become what `state` said."""
        self.q, self.y = list(state["q"]), list(state["y"])
        self.vertex = {point: number for number, point in enumerate(_tuples(state["points"]))}
        sources = iter(state["sources"].tolist())
        self.untried = {
            point: [next(sources) for _ in range(count)] for point, count in zip(_tuples(state["untried"]), state["counts"], strict=True)
        }
        rest = zip(state["missed_q"], state["missed_wrong"].tolist(), state["missed_left"].tolist(), strict=True)
        self.missed = {point: Missed(*one) for point, one in zip(_tuples(state["missed"]), rest, strict=True)}
        self.between = set(_tuples(state["between"]))

    def _points(self, points: Iterable[Point]) -> Ints:
        return np.array(list(points), dtype=np.intp).reshape(-1, self._coordinates)


def _tuples(points: Ints) -> list[Point]:
    return [tuple(one) for one in points.tolist()]
