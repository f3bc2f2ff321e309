"""Maps by least squares: a lattice of task points is filled outward from the first pose, each point from the posture of a neighbour."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mobee.roadmap.alike import made_alike
from mobee.roadmap.goals import Goals
from mobee.roadmap.lattice_points import LatticePoints, Point
from mobee.roadmap.problem import Problem
from mobee.roadmap.task import Task
from mobee.robot.robot import Array

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
    scouts: int = 256


def flooded(
    problem: Problem,
    task: Task,
    spacing: Array,
    rng: np.random.Generator,
    tick: Callable[[int], None] | None = None,
    patience: Patience = Patience(),
) -> tuple[Array, Array]:
    """Poses q (V, n) and their task coordinates y (V, m): one at every point that is reached of a lattice of that spacing (m,).

    Every pose is within all tolerances and in the task's box, its y within OFF spacings of its point.  There is none where no
    first pose is found.  `tick` is told the number of vertices now and then.

    Raises:
        InvalidValue: a coordinate has no derivative.
    """
    flood = _Flood(problem, task, spacing, rng, patience)
    if flood.begin():
        going = True
        while going:
            while flood.wave():
                if tick is not None:
                    tick(len(flood.q))
            going = flood.climb() or flood.look_between() or flood.scout()
    return flood.result()


class _Flood:
    def __init__(self, problem: Problem, task: Task, spacing: Array, rng: np.random.Generator, patience: Patience) -> None:
        self._problem, self._task, self._rng, self._patience = problem, task, rng, patience
        self._goals = Goals(problem, task, OFF * spacing)
        self._lattice = LatticePoints(task.box, spacing)
        self._vertex: dict[Point, int] = {}
        self._untried: dict[Point, list[int]] = {}  # points beside vertices, and of which of these the posture is still to be tried
        self._missed: dict[Point, _Missed] = {}
        self._between: set[Point] = set()  # points off the lattice that were or are to be tried
        self.q: list[Array] = []
        self.y: list[Array] = []

    def begin(self) -> bool:
        """Find a first pose, near the start if there is one; says whether there is one."""
        start = self._problem.start[None]
        here = self._lattice.nearest(self._task.of(self._problem.model.evaluate(start)))[0]
        starts = np.concatenate([start, self._anywhere(self._patience.starts)])
        return self._solve([tuple(here.tolist())] * len(starts), starts, most=1) or any(self.scout(most=1) for _ in range(ROUNDS))

    def wave(self) -> bool:
        """Try every point beside a vertex from the posture of one; says whether there was any."""
        if not self._untried:
            return False
        points = list(self._untried)
        sources = [self._untried[point].pop(0) for point in points]
        self._untried = {point: left for point, left in self._untried.items() if left}
        self._solve(points, np.array([self.q[source] for source in sources]))
        return True

    def climb(self) -> bool:
        """Try every point that was missed from about the least bad posture it had so far; says whether there was any to try."""
        points = [point for point, missed in self._missed.items() if missed.left > 0]
        if not points:
            return False
        for point in points:
            self._missed[point].left -= 1
        each = self._patience.starts
        starts = self._about(np.repeat([self._missed[point].q for point in points], each, axis=0))
        random = np.tile(np.arange(each) < ANYWHERE * each, len(points))
        starts[random] = self._anywhere(int(random.sum()))
        self._solve([point for point in points for _ in range(each)], starts)
        return True

    def look_between(self) -> bool:
        """Have the points between the lattice's tried around those that were missed; says whether there are any new ones."""
        missed = [point for point in self._missed if point not in self._between]
        found = False
        for point, halves in zip(missed, self._lattice.between(np.array(missed)) if missed else [], strict=True):
            for half in halves:
                if half not in self._between and self._is_free(half):
                    self._between.add(half)
                    self._missed[half] = _Missed(self._missed[point].q, np.inf, self._patience.between)
                    found = True
        return found

    def scout(self, most: int | None = None) -> bool:
        """Try points of the box that no vertex is near, from anywhere; says whether one was reached."""
        low, high = self._task.box.T
        drawn = self._lattice.nearest(self._rng.uniform(low, high, (self._patience.scouts, len(low))))
        points = [point for point in map(tuple, drawn.tolist()) if point not in self._vertex and point not in self._missed]
        return self._solve(points, self._anywhere(len(points)), most, remember=False)

    def result(self) -> tuple[Array, Array]:
        """Poses (V, n) and task points (V, m), neighbours' postures made alike."""
        q, y = np.array(self.q).reshape(-1, len(self._problem.start)), np.array(self.y).reshape(-1, len(self._task.box))
        points = np.array(list(self._vertex), dtype=np.intp).reshape(-1, len(self._task.box))
        pairs = [(k, self._vertex[one]) for k, beside in enumerate(self._lattice.around(points)) for one in beside if one in self._vertex]
        between = np.array([pair for pair in pairs if pair[0] < pair[1]], dtype=np.intp).reshape(-1, 2)
        return made_alike(self._goals, self._lattice.y(points), q, y, between, self._rng)

    def _solve(self, points: Sequence[Point], starts: Array, most: int | None = None, remember: bool = True) -> bool:
        """Add the points that are reached from the starts, `most` of them; says whether any was."""
        if not points:
            return False
        q, y, wrong, costs = self._goals.solve(self._lattice.y(np.array(points)), starts)
        added: list[Point] = []
        for k in np.lexsort((costs, wrong)).tolist():
            point = points[k]
            if point in self._vertex:
                continue
            if wrong[k] == 0.0 and (most is None or len(added) < most) and self._is_free(point):
                self._vertex[point] = len(self.q)
                self.q.append(q[k])
                self.y.append(y[k])
                added.append(point)
            elif remember:
                known = self._missed.setdefault(point, _Missed(q[k], np.inf, self._patience.hopeless))
                if wrong[k] < known.wrong:
                    if np.isinf(known.wrong) and point not in self._between:
                        known.left += self._patience.tries - self._patience.hopeless
                    known.q, known.wrong = q[k], float(wrong[k])
        if added:
            self._spread(added)
        return bool(added)

    def _spread(self, added: Sequence[Point]) -> None:
        """Remember which points are beside new vertices."""
        for point, beside in zip(added, self._lattice.around(np.array(added)), strict=True):
            self._untried.pop(point, None)
            self._missed.pop(point, None)
            for one in beside:
                if one not in self._vertex and self._is_free(one):
                    self._untried.setdefault(one, []).append(self._vertex[point])

    def _is_free(self, point: Point) -> bool:
        """Whether no vertex is too near to a point."""
        return not self._between or not any(one in self._vertex for one in self._lattice.close(point))

    def _about(self, q: Array) -> Array:
        """Starts about postures q (N, n)."""
        low, high = self._problem.limits.T
        moved, free = q.copy(), self._problem.free
        noise = self._rng.choice(NOISES, (len(q), 1)) * (high - low) * self._rng.standard_normal((len(q), len(free)))
        moved[:, free] = np.clip(q[:, free] + noise, low, high)
        return moved

    def _anywhere(self, count: int) -> Array:
        """Random starts (count, n)."""
        low, high = self._problem.limits.T
        return self._problem.whole(self._rng.uniform(low, high, (count, len(low))))


class _Missed:
    """A point that was not reached so far: the least bad posture, what is wrong with it, and how often it is still to be tried."""

    def __init__(self, q: Array, wrong: float, left: int) -> None:
        self.q, self.wrong, self.left = q, wrong, left
