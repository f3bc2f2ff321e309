# SPDX-License-Identifier: Apache-2.0
"""Builds a roadmap: each evolution-strategy search starts at a vertex and finds a new vertex near it (thesis Algorithms 3 and 4)."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.errors import MobeeError
from mobee.roadmap.building.frontier import MAX_NEAREST, MAX_NEIGHBOURS, MIN_DISTANCE, Flags, Frontier, GrowingArray
from mobee.roadmap.building.search_scheduler import IDLE, SearchScheduler, SearchSettings
from mobee.roadmap.evolution.nes import default_population
from mobee.roadmap.ik.problem import Problem
from mobee.roadmap.ik.terms import Term

if TYPE_CHECKING:
    from mobee.roadmap.building.tasks import Task

OUTSIDE_SCALE = 0.25  # spacings outside the box that cost as much as a term at its tolerance
STRICT_FACTOR = 10.0  # on the weight of a term of tolerance 0
BATCH = 80  # poses per call of the model; fixed, so that results do not depend on the number of threads


@dataclass(frozen=True, slots=True, eq=False)
class EvaluatedPoses:
    """The evaluation of N poses.

    `cost`: (N,) sum of the costs of all terms (`mobee.costs`), plus a penalty for a point outside the task's box: the sum of the squared
    excesses of its coordinates, each in units of 0.25 spacings. `valid`: (N,) whether all terms are within their tolerances and the point
    is inside the box. `point`: (N, m) task coordinates divided by the spacing.
    """

    cost: Array
    valid: NDArray[np.bool_]
    point: Array


class PoseEvaluator:
    """Evaluates the cost, validity and task coordinates of poses.

    `problem`: has the robot's model and the terms of the cost. `task`: the task space and its box (the ranges of its coordinates).
    `spacing`: (m,) distance between vertices in each task coordinate. `pool`: executor whose threads share the work; None: one thread.
    """

    def __init__(self, problem: Problem, task: Task, spacing: Array, pool: Executor | None = None) -> None:
        self.problem, self.task, self.spacing = problem, task, spacing
        self.low, self.high = (task.box / spacing[:, None]).T
        self._pool = pool

    def evaluate(self, q: Array) -> EvaluatedPoses:
        """Evaluate poses q (N, n) rad, and add their number to `problem.evaluations`.

        The result of a pose does not depend on the other poses.
        """
        self.problem.evaluations += len(q)
        batches = [q[k : k + BATCH] for k in range(0, len(q), BATCH)]
        if len(batches) == 1:
            return self._evaluate(q)
        done = list(map(self._evaluate, batches) if self._pool is None else self._pool.map(self._evaluate, batches))
        return EvaluatedPoses(*(np.concatenate(column) for column in zip(*((one.cost, one.valid, one.point) for one in done), strict=True)))

    def violations(self, q: Array) -> str:
        """Return a text that lists the terms not within their tolerances, and the task coordinates outside the box, in a pose (n,) rad."""
        pose = self.problem.model.evaluate(q[None])
        found = [
            f"{name} by {float(term.residual(pose)[0]):.3g} (tolerance {term.tolerance:.3g})"
            for name, term in self.problem.by_name.items()
            if term.tolerance is not None and not term.residual(pose)[0] <= term.tolerance
        ]
        y, box = self.task.of(pose)[0], self.task.box
        found += [
            f"{name} is {value:.3g}, outside {low:.3g} .. {high:.3g}"
            for name, value, (low, high) in zip(self.task.names, y, box, strict=True)
            if not low <= value <= high
        ]
        return ", ".join(found)

    def _evaluate(self, q: Array) -> EvaluatedPoses:
        pose = self.problem.model.evaluate(q)
        cost, valid = np.zeros(len(q)), np.ones(len(q), dtype=bool)
        for term in self.problem.terms:
            residual = term.residual(pose)
            cost += scaled_cost(term, residual)
            if term.tolerance is not None:
                valid &= residual <= term.tolerance
        point = self.task.of(pose) / self.spacing
        outside = np.maximum(0.0, np.maximum(self.low - point, point - self.high))
        cost += ((outside / OUTSIDE_SCALE) ** 2).sum(axis=1)
        valid &= (outside == 0.0).all(axis=1)
        return EvaluatedPoses(cost, valid, point)


def scaled_cost(term: Term, residual: Array) -> Array:
    """Return the cost (N,) of the residuals (N,) that a term has in N poses, scaled by its tolerance for an evolution strategy.

    It is (residual / tolerance)^2. For tolerance 0 it is 1 + 10 weight residual where the residual is above 0, else 0. Without a tolerance
    it is weight * residual.
    """
    if term.tolerance is None:
        return term.weight * residual
    if term.tolerance == 0.0:
        return STRICT_FACTOR * term.weight * residual + (residual > 0.0)
    return (residual / term.tolerance) ** 2


NEIGHBOUR_SCALE = 0.25  # spacings of deviation from 1 that cost 1 (eq. 3.6)
AIM_SCALE = 0.5  # spacings from the aim that cost 1
LIMIT_COST = 1000.0  # of a sample that was clipped to the limits: times its squared distance, in ranges of the motors


class FrontierBuilder:
    """Grows a roadmap by searches with an evolution strategy (thesis Algorithms 3 and 4).

    Each `step` computes one generation of every search and adds the vertices that the searches found. The attribute `frontier` holds the
    points of the vertices in the task space, divided by `evaluator.spacing`. The attribute `problem` is the evaluator's pose search
    problem; it also counts the evaluated poses.

    Args:
        evaluator: computes the costs and task coordinates of poses.
        settings: settings of the searches.
        rng: draws all random numbers.
    """

    def __init__(self, evaluator: PoseEvaluator, settings: SearchSettings, rng: np.random.Generator) -> None:
        self.evaluator, self.problem, self.rng = evaluator, evaluator.problem, rng
        self._low, self._high = self.problem.limits.T
        start = (self.problem.start[self.problem.free] - self._low) / (self._high - self._low)
        self._has_aims = settings.frontier
        self.frontier = Frontier(evaluator.low, evaluator.high)
        self._postures = GrowingArray(start.shape)  # the free motors of the vertices, in fractions of their ranges
        population = settings.population or default_population(len(start))
        self.scheduler = SearchScheduler(self.frontier, self._postures, start, settings, population, rng)
        self._best, self._best_cost = start, np.inf  # of the search for the first pose

    @property
    def vertices(self) -> int:
        """Number of vertices found so far."""
        return len(self.frontier)

    @property
    def open(self) -> int:
        """Number of vertices from which a search may still start."""
        return int(self.scheduler.expandable().sum())

    def result(self) -> tuple[Array, Array]:
        """Return the poses (V, n) rad of the vertices and their task coordinates (V, m)."""
        return self._poses(self._postures.rows), self.frontier.points * self.evaluator.spacing

    def begin_from(self, q: Array, y: Array) -> None:
        """Add poses q (V, n) rad at task coordinates y (V, m) as the first vertices."""
        postures = (q[:, self.problem.free] - self._low) / (self._high - self._low)
        for posture, point in zip(postures, y / self.evaluator.spacing, strict=True):
            self._add(posture, point)

    def step(self) -> bool:
        """Compute one generation of each running search and add the vertices found; return False if no search runs and none can start.

        Raises:
            MobeeError: all searches for the first vertex have ended, and none has found a valid pose.
        """
        self.scheduler.refill()
        which = np.flatnonzero(self.scheduler.vertex != IDLE)
        if not len(which):
            if self.scheduler.exhausted:
                raise MobeeError(self._failure())
            return False
        searches = self.scheduler.searches
        z = self.rng.standard_normal((len(which), searches.population, len(self._low)))
        samples = searches.ask(which, z)
        inside = np.minimum(np.maximum(samples, 0.0), 1.0)
        done = self.evaluator.evaluate(self._poses(inside.reshape(-1, inside.shape[-1])))
        points, cost, valid = done.point.reshape(*z.shape[:2], -1), done.cost.reshape(z.shape[:2]), done.valid.reshape(z.shape[:2])
        if len(self.frontier):
            more, spread = self._spacing_cost(which, points)
            cost, valid = cost + more, valid & spread
        elif cost.min() < self._best_cost:
            self._best, self._best_cost = inside.reshape(-1, inside.shape[-1])[cost.argmin()], float(cost.min())
        searches.tell(which, z, cost + LIMIT_COST * ((samples - inside) ** 2).sum(axis=2))
        for k in np.flatnonzero(valid.any(axis=1)):
            if self.scheduler.vertex[which[k]] != IDLE:
                self._commit(int(which[k]), inside[k], points[k], np.where(valid[k], cost[k], np.inf))
        self.scheduler.end_failed()
        return True

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the state of the builder without that of `rng`, as arrays by name, for `restore`.

        "q" and "y" are the poses (V, n) rad and the task coordinates (V, m) of the vertices.
        """
        q, y = self.result()
        known = {"q": q, "y": y, "postures": self._postures.rows, "places": self.frontier.points, "weights": self.frontier.weights}
        return self.scheduler.state() | known | {"best": self._best, "best_cost": np.array(self._best_cost)}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Continue from `state`, which the method `state` of a builder with the same settings has returned."""
        for posture, point in zip(state["postures"], state["places"], strict=True):
            self._add(posture, point)
        self.frontier.weights[:] = state["weights"]
        self.scheduler.restore(state)
        self._best, self._best_cost = state["best"], float(state["best_cost"])

    def _add(self, posture: Array, point: Array) -> Array | None:
        self._postures.append(posture)
        return self.frontier.add(point)

    def _poses(self, postures: Array) -> Array:
        """Return all motors (N, n) rad from fractions of the ranges of the free ones (N, d)."""
        return self.problem.whole(np.minimum(self._low + postures * (self._high - self._low), self._high))

    def _spacing_cost(self, which: Ints, points: Array) -> tuple[Array, Flags]:
        """Return the cost of the distances of points from the map, and whether each point is neither too near to its vertices nor too far.

        The cost grows with the difference between 1 spacing and the distance to each of the m nearest vertices (thesis eq. 3.6), and with
        the distance from the aim of the search, if the setting `frontier` is on. `which`: numbers of k searches. `points`: (k, population,
        m), in spacings. Both results have the shape (k, population).
        """
        n = min(self.frontier.dimensions, len(self.frontier))
        squares = ((points[:, :, None] - self.scheduler.near[which, None]) ** 2).sum(axis=-1)
        nearest = np.sqrt(np.sort(np.partition(squares, n - 1, axis=-1)[..., :n], axis=-1))
        cost: Array = (((nearest - 1.0) / NEIGHBOUR_SCALE) ** 2).sum(axis=-1)
        if self._has_aims:
            cost += ((points - self.scheduler.aim[which, None]) ** 2).sum(axis=-1) / AIM_SCALE**2
        valid: Flags = (nearest[..., 0] >= MIN_DISTANCE) & (nearest[..., 0] <= MAX_NEAREST) & (nearest[..., -1] <= MAX_NEIGHBOURS)
        return cost, valid

    def _commit(self, number: int, postures: Array, points: Array, cost: Array) -> None:
        """Add the result of a search to the map, and end the search; if no sample is accepted, do nothing.

        The result is the sample with the lowest cost among those that the frontier accepts, which now may have more vertices than when the
        search began. `number`: of the search. Its samples: `postures` (P, d), as fractions of the ranges of the free motors; `points`
        (P, m), their task coordinates; `cost` (P,), infinite for samples that are not valid.
        """
        for k in np.argsort(cost, kind="stable"):
            if not np.isfinite(cost[k]):
                return
            if self.frontier.accepts(points[k]):
                self.scheduler.end_successful(number, points[k], self._add(postures[k], points[k]))
                return

    def _failure(self) -> str:
        return (
            f"no pose was found that meets all costs inside the task's box, by {self.problem.evaluations} evaluations from the start and "
            f"from random postures. The best one misses {self.evaluator.violations(self._poses(self._best[None])[0])}. Loosen a tolerance, "
            f"widen the box, let more motors move, or give a start that is nearer."
        )
