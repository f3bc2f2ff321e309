"""Poses whose task coordinates have given values, by least squares."""

from __future__ import annotations

import numpy as np

from mobee.errors import InvalidValue
from mobee.pose import Pose
from mobee.roadmap.building.task import Task
from mobee.roadmap.ik.least_squares import Descent, aim_reals
from mobee.roadmap.ik.problem import Problem
from mobee.roadmap.ik.term import Aim
from mobee.robot.robot import Array


class Goals:
    """A problem's terms and a task's coordinates, to be met at once.

    `off`: (m,) how much each coordinate may miss.  Raises InvalidValue for a coordinate that has no derivative.
    """

    def __init__(self, problem: Problem, task: Task, off: Array) -> None:
        for one in task.coordinates:
            if one.aims is None:
                raise InvalidValue(
                    f"task coordinate {one.name!r} has no derivative, so least squares cannot follow it: "
                    "build the map with method='nes', or take a coordinate of mobee.tasks that has one."
                )
        self._problem, self._task, self._off = problem, task, off
        self._known: list[dict[float, Array]] = [{} for _ in task.coordinates]
        self._descent = Descent(problem, [pair for number, low in enumerate(task.box[:, 0]) for pair in self._aims(number, float(low))])

    def anywhere(self, count: int, rng: np.random.Generator) -> Array:
        """Random starts (count, n): of the motors that the aims and terms need, the others stay where the problem starts."""
        low, high = self._problem.limits.T
        drawn = rng.uniform(low, high, (count, len(low)))
        return self._problem.whole(np.where(self._descent.drawn, drawn, self._problem.start[self._problem.free]))

    def about(self, q: Array, noise: Array, rng: np.random.Generator) -> Array:
        """Starts about postures q (N, n): noise (N,) in the motors' ranges, of the motors that the aims and terms need."""
        low, high = self._problem.limits.T
        here = q[:, self._problem.free]
        drawn = noise[:, None] * (high - low) * rng.standard_normal(here.shape)
        return self._problem.whole(np.clip(here + np.where(self._descent.drawn, drawn, 0.0), low, high))

    def solve(self, y: Array, starts: Array) -> tuple[Array, Array, Array, Array]:
        """What the starts (N, n) lead to for task points y (N, m): poses (N, n), their task points, what is wrong and their costs (N,).

        Of the starts the motors that may move count, within their limits.
        What is wrong: 0 of a pose within all tolerances and the task's box, infinite where least squares fails, else the weighed sum of
        the terms that miss too much.
        """
        free = self._problem.free
        q, met = self._descent.met(self._problem.whole(np.clip(starts[:, free], *self._problem.limits.T)), self._reals(y))
        there, wrong, costs = np.full(y.shape, np.inf), np.full(len(y), np.inf), np.full(len(y), np.inf)
        pose = self._problem.model.evaluate(q[met])
        there[met] = self._task.of(pose)
        wrong[met], costs[met] = self._judged(pose)
        box = self._task.box
        wrong[~(((there >= box[:, 0]) & (there <= box[:, 1]) & (np.abs(there - y) <= self._off)).all(axis=1))] = np.inf
        return q, there, wrong, costs

    def _judged(self, pose: Pose) -> tuple[Array, Array]:
        self._problem.evaluations += len(pose.q)
        wrong, costs = np.zeros(len(pose.q)), np.zeros(len(pose.q))
        for one in self._problem.terms:
            missing = one.residual(pose)
            costs += one.weight * missing
            if one.tolerance is not None:
                wrong += np.where(missing > one.tolerance, one.weight * missing, 0.0)
        return wrong, costs

    def _reals(self, y: Array) -> Array:
        """Those of the coordinates' aims, a row for each task point, see `least_squares.aim_reals`."""
        columns = []
        for number, known in enumerate(self._known):
            values, which = np.unique(y[:, number], return_inverse=True)
            for value in values.tolist():
                if value not in known:
                    known[value] = aim_reals(self._aims(number, value))
            columns.append(np.stack([known[value] for value in values.tolist()])[which])
        return np.concatenate(columns, axis=1)

    def _aims(self, number: int, value: float) -> list[tuple[Aim, float]]:
        aims = self._task.coordinates[number].aims
        return [] if aims is None else [(aim, float(self._off[number])) for aim in aims(self._problem.model.robot, value)]
