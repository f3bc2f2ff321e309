# SPDX-License-Identifier: Apache-2.0
"""Builds a roadmap: finds poses for the points of a lattice in the task space by least squares, outward from a first pose."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.roadmap.building.task_ik import TaskIK, smoothed
from mobee.roadmap.building.tasks import Task
from mobee.roadmap.ik.problem import Problem

Point = tuple[int, ...]  # in half edges from the origin: a lattice point where all numbers are even, else an intermediate point
MIN_DISTANCE = 0.8  # spacings: no two points are used that are nearer to each other
_MAX_DIMENSIONS = 3  # of a task space with intermediate points; in more dimensions there are too many
_ROUNDING = 1e-9  # spacings


class Lattice:
    """The points of a lattice in a box of a task space; neighbours are one spacing apart, and one point is the middle of the box.

    A point is a tuple of m whole numbers p: its place is the middle of the box plus the sum of p[i] / 2 times basis vector i of the
    lattice. If all numbers are even, it is a lattice point; otherwise it is an intermediate point, half-way between lattice points.
    Intermediate points fill the gaps that the lattice leaves at the border of the reachable region. `box`: (m, 2), `spacing`: (m,), in the
    units of the task coordinates.
    """

    def __init__(self, box: Array, spacing: Array) -> None:
        self._spacing = spacing
        self._origin = box.mean(axis=1)
        self._width = 0.5 * (box[:, 1] - box[:, 0]) / spacing + _ROUNDING
        self._edges = 0.5 * _lattice_edges(len(spacing))
        offsets = _offsets(len(spacing))
        distances = np.linalg.norm(offsets @ self._edges, axis=1)
        self._neighbours = offsets[distances < 1.0 + _ROUNDING]
        self._halves = offsets[distances < 0.5 + _ROUNDING]
        self._close = [tuple(offset) for offset in offsets[distances < MIN_DISTANCE].tolist()]

    def y(self, points: Ints) -> Array:
        """Return the task coordinates (N, m) of lattice or intermediate points, each in the unit of its coordinate (for example m or rad).

        `points`: (N, m) whole numbers. The point of a row p is the middle of the box plus the sum of p[i] / 2 times basis vector i.
        """
        found: Array = self._origin + (points @ self._edges) * self._spacing
        return found

    def neighbours(self, points: Ints) -> list[list[Point]]:
        """Return for each point a list of the lattice points in the task's box at most one spacing away, without the point itself.

        `points`: (N, m) whole numbers. The point of a row p is the middle of the box plus the sum of p[i] / 2 times basis vector i of the
        lattice. Each point of the result is a tuple p of the same form.
        """
        return self._shifted(points, self._neighbours, lattice_only=True)

    def intermediate(self, points: Ints) -> list[list[Point]]:
        """Return for each lattice point a list of the intermediate points in the task's box that are half a spacing away.

        `points`: (N, m) whole numbers. The point of a row p is the middle of the box plus the sum of p[i] / 2 times basis vector i of the
        lattice. Each point of the result is a tuple p of the same form.
        """
        return self._shifted(points, self._halves, lattice_only=False)

    def too_close(self, point: Point) -> list[Point]:
        """Return the other lattice and intermediate points nearer than MIN_DISTANCE (0.8 spacings) to a point, also those outside the box.

        Each point is a tuple p of m whole numbers: the middle of the box plus the sum of p[i] / 2 times basis vector i of the lattice.
        """
        return [tuple(a + b for a, b in zip(point, offset, strict=True)) for offset in self._close]

    def nearest(self, y: Array) -> Ints:
        """Return for each of N task coordinates y (N, m) a lattice point in the task's box that is approximately the nearest one.

        The result (N, m) has whole numbers. The point of a row p is the middle of the box plus the sum of p[i] / 2 times basis vector i of
        the lattice; all p[i] are even.
        """
        scaled = np.clip((y - self._origin) / self._spacing, -self._width, self._width)
        edges = 0.5 * scaled @ np.linalg.inv(self._edges)
        whole, inward = (2 * rounded.astype(np.intp)[:, None] for rounded in (np.rint(edges), np.trunc(edges)))
        even = self._neighbours[(self._neighbours % 2 == 0).all(axis=1)]
        candidates = np.concatenate([np.zeros_like(whole), whole, whole + even, inward], axis=1)  # the first, the origin, is in the box
        there = candidates @ self._edges
        squares = ((there - scaled[:, None]) ** 2).sum(axis=2)
        squares[(np.abs(there) > self._width).any(axis=2)] = np.inf
        found: Ints = candidates[np.arange(len(y)), squares.argmin(axis=1)]
        return found

    def _shifted(self, points: Ints, offsets: Ints, lattice_only: bool) -> list[list[Point]]:
        shifted = points[:, None] + offsets
        invalid = (np.abs(shifted @ self._edges) > self._width).sum(axis=2)
        if lattice_only:
            invalid += (shifted % 2).sum(axis=2)
        return [[tuple(one) for one in near[bad == 0].tolist()] for near, bad in zip(shifted, invalid, strict=True)]


def _lattice_edges(dimensions: int) -> Array:
    """Return the edges of the lattice (m, m), one per row, of length 1: hexagonal in 2-D, face-centred cubic in 3-D, else cubic.

    Among lattices with the same number of points, the first two have the smallest gaps.
    """
    if dimensions == 2:
        return np.array([[1.0, 0.0], [0.5, np.sqrt(0.75)]])
    if dimensions == 3:
        side = np.sqrt(0.5)
        return np.array([[side, side, 0.0], [side, 0.0, side], [0.0, side, side]])
    return np.eye(dimensions)


def _offsets(dimensions: int) -> Ints:
    """Return the offsets (k, m) from a point of the lattice to the points near it, in whole numbers of half basis vectors (edges).

    They are all combinations of -2 to 2, without the point itself; above _MAX_DIMENSIONS they are only the neighbours along each edge.
    """
    if dimensions > _MAX_DIMENSIONS:
        return np.concatenate([2 * np.eye(dimensions, dtype=np.intp), -2 * np.eye(dimensions, dtype=np.intp)])
    return np.array([offset for offset in product(range(-2, 3), repeat=dimensions) if any(offset)])


@dataclass(slots=True, eq=False)
class FailedPoint:
    """A lattice point, or a point half-way between lattice points, for which no valid pose was found so far.

    `q`: (n,) rad, the best posture found; for an intermediate point that was not tried yet, the posture of the lattice point beside it.
    `violation`: sum of weight * residual over the terms of the cost that the posture `q` violates (residual above tolerance); infinite if
    least squares has found no posture at the point. `left`: number of tries left.
    """

    q: Array
    violation: float
    left: int


class PointTable:
    """The status of the points of a `Lattice`: which were reached, are to be tried, or have failed.

    `vertex`: dict from each point that was reached to the number of its vertex. `q`, `y`: lists of the poses (n,) rad and task coordinates
    (m,) of the vertices, by number. `untried`: dict from each lattice point that is to be tried to a list of vertices next to it; the
    postures of these vertices are the start postures for least squares that were not yet tried for this point. `failed`: dict from each
    point without a valid pose so far to its `FailedPoint`. `intermediate`: the points half-way between lattice points that were tried or
    are to be tried.

    Args:
        motors: number n of motors of the robot.
        coordinates: number m of task coordinates.
    """

    def __init__(self, motors: int, coordinates: int) -> None:
        self._motors, self._coordinates = motors, coordinates
        self.vertex: dict[Point, int] = {}
        self.q: list[Array] = []
        self.y: list[Array] = []
        self.untried: dict[Point, list[int]] = {}
        self.failed: dict[Point, FailedPoint] = {}
        self.intermediate: set[Point] = set()

    def vertices(self) -> tuple[Ints, Array, Array]:
        """Return the points of the vertices, their poses (V, n) rad and task coordinates (V, m).

        The points are (V, m) whole numbers, lattice or intermediate points of the `Lattice`.
        """
        q = np.array(self.q, dtype=np.float64).reshape(-1, self._motors)
        y = np.array(self.y, dtype=np.float64).reshape(-1, self._coordinates)
        return self._points(self.vertex), q, y

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the content of this table as a dict of arrays, from which `restore` can fill another table.

        Among them are the poses "q" (V, n) rad and task coordinates "y" (V, m) of the vertices.
        """
        points, q, y = self.vertices()
        failed = self.failed.values()
        return {
            "points": points,
            "q": q,
            "y": y,
            "untried": self._points(self.untried),
            "sources": np.array([source for sources in self.untried.values() for source in sources], dtype=np.intp),
            "counts": np.array([len(sources) for sources in self.untried.values()], dtype=np.intp),
            "missed": self._points(self.failed),
            "missed_q": np.array([one.q for one in failed]).reshape(-1, self._motors),
            "missed_wrong": np.array([one.violation for one in failed], dtype=np.float64),
            "missed_left": np.array([one.left for one in failed], dtype=np.intp),
            "between": self._points(sorted(self.intermediate)),
        }

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Replace the content of this table by `state`, which the method `state` of another table has returned."""
        self.q, self.y = list(state["q"]), list(state["y"])
        self.vertex = {point: number for number, point in enumerate(_tuples(state["points"]))}
        sources = iter(state["sources"].tolist())
        self.untried = {
            point: [next(sources) for _ in range(count)] for point, count in zip(_tuples(state["untried"]), state["counts"], strict=True)
        }
        columns = zip(state["missed_q"], state["missed_wrong"].tolist(), state["missed_left"].tolist(), strict=True)
        self.failed = {point: FailedPoint(*one) for point, one in zip(_tuples(state["missed"]), columns, strict=True)}
        self.intermediate = set(_tuples(state["between"]))

    def _points(self, points: Iterable[Point]) -> Ints:
        return np.array(list(points), dtype=np.intp).reshape(-1, self._coordinates)


def _tuples(points: Ints) -> list[Point]:
    return [tuple(one) for one in points.tolist()]


MAX_DEVIATION = 0.02  # spacings between a vertex and its point, in any coordinate
START_STDS = np.array([0.02, 0.05, 0.1, 0.2])  # in ranges of the motors: standard deviations of the starts around a posture
RANDOM_SHARE = 0.25  # of the starts for a failed point
FIRST_ROUNDS = 8  # of tries at random points, until the first pose is found


@dataclass(frozen=True, slots=True)
class Patience:
    """Limits of the work on a lattice point that was not reached from the postures of its neighbours.

    `starts`: number of start postures of least squares in each try. `tries`: largest number of tries of a lattice point at which least
    squares has found a posture that only violates tolerances, for example because it has contacts. `hopeless`: largest number of tries
    of a lattice point at which least squares has found no posture at all. `between`: largest number of tries of an intermediate point,
    half-way between lattice points. `scouts`: number of random positions in the task's box that are drawn when no other points are left;
    the lattice points nearest to these positions are then tried.
    """

    starts: int = 8
    tries: int = 12
    hopeless: int = 3
    between: int = 1
    scouts: int = 1024


_DEFAULT = Patience()


def lattice_poses(
    problem: Problem,
    task: Task,
    spacing: Array,
    rng: np.random.Generator,
    progress: Callable[[int], None] | None = None,
    patience: Patience = _DEFAULT,
) -> tuple[Array, Array]:
    """Return poses q (V, n) rad and their task coordinates y (V, m), one for every reachable point of a lattice over the task's box.

    Every pose is within all tolerances and in the task's box; its y is within MAX_DEVIATION (0.02 spacings) of its lattice point. V is 0 if
    no first pose is found.

    Args:
        problem: the terms of the cost of a pose, and the motors that may move.
        task: the task coordinates and their box.
        spacing: (m,) distance between lattice points in each task coordinate.
        rng: draws all random numbers.
        progress: called with the number of vertices after each step; None: no reports.
        patience: limits of the work on points that are hard to reach.

    Raises:
        InvalidValue: a task coordinate has no derivative.
    """
    builder = LatticeBuilder(problem, task, spacing, rng, patience)
    while builder.step():
        if progress is not None:
            progress(builder.vertices)
    return builder.result()


class LatticeBuilder:
    """Finds a pose for every reachable point of a lattice in the task space, step by step, outward from the first pose.

    `problem`: the terms of the cost of a pose, and the motors that may move. `task`: the task coordinates and their box. `spacing`: (m,)
    distance between lattice points in each task coordinate. `rng`: draws all random numbers. `patience`: limits of the work on points that
    are hard to reach. Raises InvalidValue if a task coordinate has no derivative.
    """

    def __init__(self, problem: Problem, task: Task, spacing: Array, rng: np.random.Generator, patience: Patience = _DEFAULT) -> None:
        self.problem, self.rng = problem, rng
        self._task, self._patience = task, patience
        self._ik = TaskIK(problem, task, MAX_DEVIATION * spacing)
        self._lattice = Lattice(task.box, spacing)
        self._table = PointTable(len(problem.start), len(spacing))

    @property
    def vertices(self) -> int:
        """Number of vertices (points for which a valid pose was found) so far."""
        return len(self._table.q)

    @property
    def open(self) -> int:
        """Number of lattice points that least squares must still try to reach from the posture of a vertex next to them."""
        return len(self._table.untried)

    def step(self) -> bool:
        """Search for poses at the next points of the lattice; return False if the building is finished.

        A step tries the points next to vertices. If there are none, it tries failed points again; if none is left, it adds points half-way
        between lattice points; then it tries random points. The building is finished if no pose is found for any of these random points, or
        if no first pose is found.
        """
        if not self.vertices:
            return self._find_first()
        return self._try_neighbours() or self._retry_failed() or self._add_intermediate() or self._try_random_points()

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the state, except that of `rng`, as arrays by name; "q" and "y" are the poses and task coordinates of the vertices."""
        return self._table.state()

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Continue from `state`, which the method `state` of a builder with the same settings has returned."""
        self._table.restore(state)

    def result(self) -> tuple[Array, Array]:
        """Return the poses (V, n) rad of the vertices and their task coordinates (V, m).

        Before that, the method solves some poses again, so that the postures of neighbours are more similar (`smoothed`).
        """
        points, q, y = self._table.vertices()
        vertex = self._table.vertex
        pairs = [(k, vertex[one]) for k, neighbours in enumerate(self._lattice.neighbours(points)) for one in neighbours if one in vertex]
        once = np.array([pair for pair in pairs if pair[0] < pair[1]], dtype=np.intp).reshape(-1, 2)
        return smoothed(self._ik, self._lattice.y(points), q, y, once, self.rng)

    def _find_first(self) -> bool:
        """Find a first pose, near the start if possible; return whether one was found."""
        start = self.problem.start[None]
        here = self._lattice.nearest(self._task.of(self.problem.model.evaluate(start)))[0]
        starts = np.concatenate([start, self._ik.random_starts(self._patience.starts, self.rng)])
        if self._solve([tuple(here.tolist())] * len(starts), starts, limit=1):
            return True
        return any(self._try_random_points(limit=1) for _ in range(FIRST_ROUNDS))

    def _try_neighbours(self) -> bool:
        """Try every untried point from the posture of a vertex next to it; return whether there was any."""
        if not self._table.untried:
            return False
        points = list(self._table.untried)
        sources = [self._table.untried[point].pop(0) for point in points]
        self._table.untried = {point: left for point, left in self._table.untried.items() if left}
        self._solve(points, np.array([self._table.q[source] for source in sources]))
        return True

    def _retry_failed(self) -> bool:
        """Try every failed point from starts around its best posture; return whether any was left to try."""
        points = [point for point, failed in self._table.failed.items() if failed.left > 0]
        if not points:
            return False
        for point in points:
            self._table.failed[point].left -= 1
        each = self._patience.starts
        best = np.repeat([self._table.failed[point].q for point in points], each, axis=0)
        starts = self._ik.starts_around(best, self.rng.choice(START_STDS, len(best)), self.rng)
        random = np.tile(np.arange(each) < RANDOM_SHARE * each, len(points))
        starts[random] = self._ik.random_starts(int(random.sum()), self.rng)
        self._solve([point for point in points for _ in range(each)], starts)
        return True

    def _add_intermediate(self) -> bool:
        """Schedule the points half-way between lattice points next to the failed ones; return whether there are new points.

        Only failed points at which least squares has found a posture count: the posture exists, but violates a term of the cost, such as
        contacts. A new point is only scheduled if no vertex is too near to it.
        """
        known = self._table.intermediate
        failed = [point for point, one in self._table.failed.items() if np.isfinite(one.violation) and point not in known]
        found = False
        for point, halves in zip(failed, self._lattice.intermediate(np.array(failed)) if failed else [], strict=True):
            for half in halves:
                if half not in known and self._is_free(half):
                    known.add(half)
                    self._table.failed[half] = FailedPoint(self._table.failed[point].q, np.inf, self._patience.between)
                    found = True
        return found

    def _try_random_points(self, limit: int | None = None) -> bool:
        """Try random points of the box that are not known, from random starts; return whether one was reached."""
        low, high = self._task.box.T
        drawn = self._lattice.nearest(self.rng.uniform(low, high, (self._patience.scouts, len(low))))
        points = [point for point in map(tuple, drawn.tolist()) if point not in self._table.vertex and point not in self._table.failed]
        return self._solve(points, self._ik.random_starts(len(points), self.rng), limit, remember=False)

    def _solve(self, points: Sequence[Point], starts: Array, limit: int | None = None, remember: bool = True) -> bool:
        """Add the points that are reached from the starts, at most `limit` of them; return whether any was.

        `remember`: keep the points that are not reached as failed ones.
        """
        if not points:
            return False
        q, y, violations, costs = self._ik.solve(self._lattice.y(np.array(points)), starts)
        added: list[Point] = []
        for k in np.lexsort((costs, violations)).tolist():
            point = points[k]
            if point in self._table.vertex:
                continue
            if violations[k] == 0.0 and (limit is None or len(added) < limit) and self._is_free(point):
                self._table.vertex[point] = len(self._table.q)
                self._table.q.append(q[k])
                self._table.y.append(y[k])
                added.append(point)
            elif remember:
                known = self._table.failed.setdefault(point, FailedPoint(q[k], np.inf, self._patience.hopeless))
                if violations[k] < known.violation:
                    if np.isinf(known.violation) and point not in self._table.intermediate:
                        known.left += self._patience.tries - self._patience.hopeless
                    known.q, known.violation = q[k], float(violations[k])
        if added:
            self._add_neighbours(added)
        return bool(added)

    def _add_neighbours(self, added: Sequence[Point]) -> None:
        """Add the points next to new vertices to the untried ones."""
        for point, neighbours in zip(added, self._lattice.neighbours(np.array(added)), strict=True):
            self._table.untried.pop(point, None)
            self._table.failed.pop(point, None)
            for one in neighbours:
                if one not in self._table.vertex and self._is_free(one):
                    self._table.untried.setdefault(one, []).append(self._table.vertex[point])

    def _is_free(self, point: Point) -> bool:
        """Return whether no vertex is too near to a point."""
        return not self._table.intermediate or not any(one in self._table.vertex for one in self._lattice.too_close(point))
