"""Roadmaps by least squares: fills a lattice of task points outward from the first pose."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.roadmap.building.goals import Goals, made_alike
from mobee.roadmap.building.lattice_points import LatticePoints, Point
from mobee.roadmap.building.task import Task
from mobee.roadmap.ik.problem import Problem


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


OFF = 0.02  # spacings that a vertex may be off its point in any coordinate
NOISES = np.array([0.02, 0.05, 0.1, 0.2])  # of the motors' ranges: standard deviations of starts about a posture
ANYWHERE = 0.25  # share of a missed point's starts that are random
ROUNDS = 8  # of scouts, until the first pose is found


@dataclass(frozen=True, slots=True)
class Patience:
    """How long a point is tried to which its neighbours' postures did not lead.

    `starts`: at once.  `tries`: how often; `hopeless`: where no posture leads there at all, contacts or not; `between`: of a point
    off the lattice.  `scouts`: points tried at once of those that no vertex is near.
    """

    starts: int = 8
    tries: int = 12
    hopeless: int = 3
    between: int = 1
    scouts: int = 1024


_DEFAULT = Patience()


def flooded(
    problem: Problem,
    task: Task,
    spacing: Array,
    rng: np.random.Generator,
    tick: Callable[[int], None] | None = None,
    patience: Patience = _DEFAULT,
) -> tuple[Array, Array]:
    """Poses q (V, n) and their task coordinates y (V, m): one at every point that is reached of a lattice of that spacing (m,).

    Every pose is within all tolerances and in the task's box, its y within OFF spacings of its point.  There is none where no
    first pose is found.  `tick` is told the number of vertices now and then.

    Raises:
        InvalidValue: a coordinate has no derivative.
    """
    flood = Flood(problem, task, spacing, rng, patience)
    while flood.step():
        if tick is not None:
            tick(flood.vertices)
    return flood.result()


class Flood:
    """A map that is being filled, see `flooded`; `rng` draws all that is random."""

    def __init__(self, problem: Problem, task: Task, spacing: Array, rng: np.random.Generator, patience: Patience = _DEFAULT) -> None:
        self.problem, self.rng = problem, rng
        self._task, self._patience = task, patience
        self._goals = Goals(problem, task, OFF * spacing)
        self._lattice = LatticePoints(task.box, spacing)
        self._known = FloodPoints(len(problem.start), len(spacing))

    @property
    def vertices(self) -> int:
        """How many there are."""
        return len(self._known.q)

    @property
    def open(self) -> int:
        """How many points beside vertices are still to be tried."""
        return len(self._known.untried)

    def step(self) -> bool:
        """Try what is to be tried next; says whether there was anything."""
        if not self.vertices:
            return self._begin()
        return self._wave() or self._climb() or self._look_between() or self._scout()

    def state(self) -> dict[str, NDArray[Any]]:
        """All that is known between two steps, but for the state of `rng`; with the vertices' poses "q" and task points "y"."""
        return self._known.state()

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on where another flood was, see `state`."""
        self._known.restore(state)

    def result(self) -> tuple[Array, Array]:
        """Poses (V, n) and task points (V, m), neighbours' postures made alike."""
        points, q, y = self._known.vertices()
        vertex = self._known.vertex
        pairs = [(k, vertex[one]) for k, beside in enumerate(self._lattice.around(points)) for one in beside if one in vertex]
        once = np.array([pair for pair in pairs if pair[0] < pair[1]], dtype=np.intp).reshape(-1, 2)
        return made_alike(self._goals, self._lattice.y(points), q, y, once, self.rng)

    def _begin(self) -> bool:
        """Find a first pose, near the start if there is one; says whether there is one."""
        start = self.problem.start[None]
        here = self._lattice.nearest(self._task.of(self.problem.model.evaluate(start)))[0]
        starts = np.concatenate([start, self._goals.anywhere(self._patience.starts, self.rng)])
        return self._solve([tuple(here.tolist())] * len(starts), starts, most=1) or any(self._scout(most=1) for _ in range(ROUNDS))

    def _wave(self) -> bool:
        """Try every point beside a vertex from the posture of one; says whether there was any."""
        if not self._known.untried:
            return False
        points = list(self._known.untried)
        sources = [self._known.untried[point].pop(0) for point in points]
        self._known.untried = {point: left for point, left in self._known.untried.items() if left}
        self._solve(points, np.array([self._known.q[source] for source in sources]))
        return True

    def _climb(self) -> bool:
        """Try every point that was missed from about the least bad posture it had so far; says whether there was any to try."""
        points = [point for point, missed in self._known.missed.items() if missed.left > 0]
        if not points:
            return False
        for point in points:
            self._known.missed[point].left -= 1
        each = self._patience.starts
        best = np.repeat([self._known.missed[point].q for point in points], each, axis=0)
        starts = self._goals.about(best, self.rng.choice(NOISES, len(best)), self.rng)
        random = np.tile(np.arange(each) < ANYWHERE * each, len(points))
        starts[random] = self._goals.anywhere(int(random.sum()), self.rng)
        self._solve([point for point in points for _ in range(each)], starts)
        return True

    def _look_between(self) -> bool:
        """Have the points between the lattice's tried around those that contacts keep out; says whether there are any new ones."""
        missed = [point for point, one in self._known.missed.items() if np.isfinite(one.wrong) and point not in self._known.between]
        found = False
        for point, halves in zip(missed, self._lattice.between(np.array(missed)) if missed else [], strict=True):
            for half in halves:
                if half not in self._known.between and self._is_free(half):
                    self._known.between.add(half)
                    self._known.missed[half] = Missed(self._known.missed[point].q, np.inf, self._patience.between)
                    found = True
        return found

    def _scout(self, most: int | None = None) -> bool:
        """Try points of the box that no vertex is near, from anywhere; says whether one was reached."""
        low, high = self._task.box.T
        drawn = self._lattice.nearest(self.rng.uniform(low, high, (self._patience.scouts, len(low))))
        points = [point for point in map(tuple, drawn.tolist()) if point not in self._known.vertex and point not in self._known.missed]
        return self._solve(points, self._goals.anywhere(len(points), self.rng), most, remember=False)

    def _solve(self, points: Sequence[Point], starts: Array, most: int | None = None, remember: bool = True) -> bool:
        """Add the points that are reached from the starts, `most` of them; says whether any was."""
        if not points:
            return False
        q, y, wrong, costs = self._goals.solve(self._lattice.y(np.array(points)), starts)
        added: list[Point] = []
        for k in np.lexsort((costs, wrong)).tolist():
            point = points[k]
            if point in self._known.vertex:
                continue
            if wrong[k] == 0.0 and (most is None or len(added) < most) and self._is_free(point):
                self._known.vertex[point] = len(self._known.q)
                self._known.q.append(q[k])
                self._known.y.append(y[k])
                added.append(point)
            elif remember:
                known = self._known.missed.setdefault(point, Missed(q[k], np.inf, self._patience.hopeless))
                if wrong[k] < known.wrong:
                    if np.isinf(known.wrong) and point not in self._known.between:
                        known.left += self._patience.tries - self._patience.hopeless
                    known.q, known.wrong = q[k], float(wrong[k])
        if added:
            self._spread(added)
        return bool(added)

    def _spread(self, added: Sequence[Point]) -> None:
        """Remember which points are beside new vertices."""
        for point, beside in zip(added, self._lattice.around(np.array(added)), strict=True):
            self._known.untried.pop(point, None)
            self._known.missed.pop(point, None)
            for one in beside:
                if one not in self._known.vertex and self._is_free(one):
                    self._known.untried.setdefault(one, []).append(self._known.vertex[point])

    def _is_free(self, point: Point) -> bool:
        """Whether no vertex is too near to a point."""
        return not self._known.between or not any(one in self._known.vertex for one in self._lattice.close(point))
