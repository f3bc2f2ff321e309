# SPDX-License-Identifier: Apache-2.0
"""Finds poses with given task coordinates by least squares, and makes the postures of neighbouring poses more similar."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.model.pose import Pose
from mobee.roadmap.building.tasks import Task
from mobee.roadmap.ik.problem import Problem
from mobee.roadmap.ik.solve import Descent, aim_reals
from mobee.roadmap.ik.terms import Aim


class TaskIK:
    """Finds poses that are within the tolerances of a problem's terms and have given task coordinates, by least squares.

    `problem`: a cost of poses; its terms are the summands. `task`: the m task coordinates, each with its range. `deviations`: (m,) largest
    accepted deviation of each task coordinate, in its unit. Raises InvalidValue for a coordinate that has no derivative.
    """

    def __init__(self, problem: Problem, task: Task, deviations: Array) -> None:
        for one in task.coordinates:
            if one.aims is None:
                raise InvalidValue(
                    f"task coordinate {one.name!r} has no derivative, so least squares cannot follow it: "
                    "build the map with method='nes', or take a coordinate of mobee.tasks that has one."
                )
        self._problem, self._task, self._deviations = problem, task, deviations
        self._cache: list[dict[float, Array]] = [{} for _ in task.coordinates]
        self._descent = Descent(problem, [pair for number, low in enumerate(task.box[:, 0]) for pair in self._aims(number, float(low))])

    def random_starts(self, count: int, rng: np.random.Generator) -> Array:
        """Draw start poses (count, n) rad for least squares.

        Motors that may move and affect the task or the terms of the problem's cost get random positions. All others are at their position
        in `problem.start`.
        """
        low, high = self._problem.limits.T
        drawn = rng.uniform(low, high, (count, len(low)))
        return self._problem.whole(np.where(self._descent.drawn, drawn, self._problem.start[self._problem.free]))

    def starts_around(self, q: Array, std: Array, rng: np.random.Generator) -> Array:
        """Draw start poses (N, n) rad around postures q (N, n) rad.

        `std`: (N,) standard deviation for each posture, as a fraction of each motor's range. Only the motors that affect the task or the
        terms of the problem's cost are varied, within their limits; motors that may not move are at `problem.start`.
        """
        low, high = self._problem.limits.T
        here = q[:, self._problem.free]
        drawn = std[:, None] * (high - low) * rng.standard_normal(here.shape)
        return self._problem.whole(np.clip(here + np.where(self._descent.drawn, drawn, 0.0), low, high))

    def solve(self, y: Array, starts: Array) -> tuple[Array, Array, Array, Array]:
        """Find poses with task coordinates y (N, m), by least squares from start poses `starts` (N, n) rad.

        Only the motors that may move are changed, within their limits.

        Returns:
            Poses (N, n) rad, their task coordinates (N, m), violations (N,) and costs (N,).  A violation is 0 for a pose within all
            tolerances and the task's box (the ranges of its coordinates); infinite if least squares fails, if the pose is outside the box,
            or if its task coordinates deviate from y by more than `deviations`; else the sum of weight * residual over the terms that are
            beyond their tolerances.  A cost is the sum of weight * residual over all terms.  If least squares fails, the cost and the task
            coordinates are infinite.
        """
        free = self._problem.free
        q, converged = self._descent.met(self._problem.whole(np.clip(starts[:, free], *self._problem.limits.T)), self._reals(y))
        reached, violations, costs = np.full(y.shape, np.inf), np.full(len(y), np.inf), np.full(len(y), np.inf)
        pose = self._problem.model.evaluate(q[converged])
        reached[converged] = self._task.of(pose)
        violations[converged], costs[converged] = self._evaluate(pose)
        box = self._task.box
        in_box = ((reached >= box[:, 0]) & (reached <= box[:, 1]) & (np.abs(reached - y) <= self._deviations)).all(axis=1)
        violations[~in_box] = np.inf
        return q, reached, violations, costs

    def _evaluate(self, pose: Pose) -> tuple[Array, Array]:
        """Return the violations (N,) and costs (N,) of poses, and count the evaluations."""
        self._problem.evaluations += len(pose.q)
        violations, costs = np.zeros(len(pose.q)), np.zeros(len(pose.q))
        for one in self._problem.terms:
            residual = one.residual(pose)
            costs += one.weight * residual
            if one.tolerance is not None:
                violations += np.where(residual > one.tolerance, one.weight * residual, 0.0)
        return violations, costs

    def _reals(self, y: Array) -> Array:
        """Return the aims (residuals for least squares) that are 0 at the task coordinates y (N, m), as numbers for the compiled core.

        Row k has the numbers for y[k], as `mobee.roadmap.ik.solve.aim_reals` orders them.
        """
        columns = []
        for number, cache in enumerate(self._cache):
            values, which = np.unique(y[:, number], return_inverse=True)
            for value in values.tolist():
                if value not in cache:
                    cache[value] = aim_reals(self._aims(number, value))
            columns.append(np.stack([cache[value] for value in values.tolist()])[which])
        return np.concatenate(columns, axis=1)

    def _aims(self, number: int, value: float) -> list[tuple[Aim, float]]:
        aims = self._task.coordinates[number].aims
        return [] if aims is None else [(aim, float(self._deviations[number])) for aim in aims(self._problem.model.robot, value)]


LONG_STEP = 0.25  # rad: postures around edges on which a motor moves further are made similar
SWEEPS = 32


def smoothed(ik: TaskIK, wanted: Array, q: Array, y: Array, pairs: Ints, rng: np.random.Generator) -> tuple[Array, Array]:
    """Make neighbouring poses of a roadmap more similar: solve some of them again, from starts nearer to the mean of their neighbours.

    Args:
        ik: finds poses with given task coordinates.
        wanted: (V, m) task coordinates that the poses should have: the points of a regular grid (lattice) in the task space.
        q: (V, n) rad, poses.
        y: (V, m) the task coordinates that the poses have.
        pairs: (E, 2) indices of poses that are neighbours.
        rng: draws, in each of 32 passes, which poses are solved again, and whether each starts at the mean or half-way from its old pose to
            the mean.

    Returns:
        Poses (V, n) rad and task coordinates (V, m).  A new pose replaces an old one if it is valid and has a smaller sum of squared joint
        distances to its neighbours.
    """
    q, y = q.copy(), y.copy()
    both = np.concatenate([pairs, pairs[:, ::-1]])
    for _ in range(SWEEPS):
        far = np.abs(q[pairs[:, 0]] - q[pairs[:, 1]]).max(axis=1) > LONG_STEP
        rough = np.zeros(len(q), dtype=bool)
        rough[pairs[far]] = True
        rough[both[rough[both[:, 0]], 1]] = True
        rough &= rng.random(len(q)) < 0.5  # two neighbours that both move could exchange their postures endlessly
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
        solved, task, violations, _ = ik.solve(wanted[chosen], q[chosen] + share * (middle - q[chosen]))
        before = np.bincount(slot, ((q[other] - q[own]) ** 2).sum(axis=1), len(chosen))
        after = np.bincount(slot, ((q[other] - solved[slot]) ** 2).sum(axis=1), len(chosen))
        better = (violations == 0.0) & (after < before)
        q[chosen[better]], y[chosen[better]] = solved[better], task[better]
    return q, y
