"""Poses with given task coordinates, by least squares, with postures similar to their neighbours'."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.model.pose import Pose
from mobee.roadmap.building.task import Task
from mobee.roadmap.ik.least_squares import Descent, aim_reals
from mobee.roadmap.ik.problem import Problem
from mobee.roadmap.ik.term import Aim


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


STEP = 0.25  # rad: where a motor moves further along an edge, the postures about it are drawn together
SWEEPS = 32


def made_alike(goals: Goals, wanted: Array, q: Array, y: Array, pairs: Ints, rng: np.random.Generator) -> tuple[Array, Array]:
    """Poses q (V, n) and task points y (V, m), of which some have been solved anew from between their neighbours' postures.

    `wanted`: (V, m) task points that are to be met; `pairs`: (E, 2) neighbours.  A new pose is taken if it is valid and nearer to its
    neighbours in joint space: it has a smaller sum of squares.
    """
    q, y = q.copy(), y.copy()
    both = np.concatenate([pairs, pairs[:, ::-1]])
    for _ in range(SWEEPS):
        far = np.abs(q[pairs[:, 0]] - q[pairs[:, 1]]).max(axis=1) > STEP
        rough = np.zeros(len(q), dtype=bool)
        rough[pairs[far]] = True
        rough[both[rough[both[:, 0]], 1]] = True
        rough &= rng.random(len(q)) < 0.5  # two that change places with each other would never meet
        chosen = np.flatnonzero(rough)
        if not len(chosen):
            continue
        number = np.full(len(q), -1)
        number[chosen] = np.arange(len(chosen))
        own, other = (both[rough[both[:, 0]]]).T
        slot = number[own]
        middle = np.zeros((len(chosen), q.shape[1]))
        np.add.at(middle, slot, q[other])
        middle /= np.bincount(slot, minlength=len(chosen))[:, None]
        share = rng.choice([0.5, 1.0], (len(chosen), 1))
        there, task, wrong, _ = goals.solve(wanted[chosen], q[chosen] + share * (middle - q[chosen]))
        before = np.bincount(slot, ((q[other] - q[own]) ** 2).sum(axis=1), len(chosen))
        after = np.bincount(slot, ((q[other] - there[slot]) ** 2).sum(axis=1), len(chosen))
        better = (wrong == 0.0) & (after < before)
        q[chosen[better]], y[chosen[better]] = there[better], task[better]
    return q, y
