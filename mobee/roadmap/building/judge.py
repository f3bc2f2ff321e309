"""Evaluates poses for a task: cost, whether all terms are satisfied, task coordinates (thesis Algorithm 3)."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.roadmap.ik.problem import Problem
from mobee.roadmap.ik.term import Term

if TYPE_CHECKING:
    from mobee.roadmap.building.task import Task

OUTSIDE = 0.25  # spacings: what a place beyond the box counts beside a term at its tolerance
STRICT = 10.0  # a term of tolerance 0 weighs about 1 at ten times what it should miss at most
AT_ONCE = 80  # poses of one call, whoever makes it


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """Of N poses: cost (N,), whether all terms are met inside the box (N,), place in spacings (N, m)."""

    cost: Array
    good: NDArray[np.bool_]
    place: Array


class Judge:
    """Sees poses, in as many threads as its pool has."""

    def __init__(self, problem: Problem, task: Task, spacing: Array, pool: Executor | None = None) -> None:
        self.problem, self.task, self.spacing = problem, task, spacing
        self.low, self.high = (task.box / spacing[:, None]).T
        self._pool = pool

    def look(self, q: Array) -> Seen:
        """Of poses q (N, n) rad; the same whatever others are looked at with them."""
        self.problem.evaluations += len(q)
        pieces = [q[k : k + AT_ONCE] for k in range(0, len(q), AT_ONCE)]
        if len(pieces) == 1:
            return self._look(q)
        seen = list(map(self._look, pieces) if self._pool is None else self._pool.map(self._look, pieces))
        return Seen(*(np.concatenate(column) for column in zip(*((one.cost, one.good, one.place) for one in seen), strict=True)))

    def missed(self, q: Array) -> str:
        """What a pose (n,) misses, in words."""
        pose = self.problem.model.evaluate(q[None])
        told = [
            f"{name} by {float(term.residual(pose)[0]):.3g} (tolerance {term.tolerance:.3g})"
            for name, term in self.problem.by_name.items()
            if term.tolerance is not None and not term.residual(pose)[0] <= term.tolerance
        ]
        y, box = self.task.of(pose)[0], self.task.box
        told += [
            f"{name} is {value:.3g}, outside {low:.3g} .. {high:.3g}"
            for name, value, (low, high) in zip(self.task.names, y, box, strict=True)
            if not low <= value <= high
        ]
        return ", ".join(told)

    def _look(self, q: Array) -> Seen:
        pose = self.problem.model.evaluate(q)
        cost, good = np.zeros(len(q)), np.ones(len(q), dtype=bool)
        for term in self.problem.terms:
            missing = term.residual(pose)
            cost += counted(term, missing)
            if term.tolerance is not None:
                good &= missing <= term.tolerance
        place = self.task.of(pose) / self.spacing
        outside = np.maximum(0.0, np.maximum(self.low - place, place - self.high))
        cost += ((outside / OUTSIDE) ** 2).sum(axis=1)
        good &= (outside == 0.0).all(axis=1)
        return Seen(cost, good, place)


def counted(term: Term, missing: Array) -> Array:
    """What a term costs: 1 at its tolerance, and its square; one that may miss nothing, 1 for missing anything; else its weight."""
    if term.tolerance is None:
        return term.weight * missing
    if term.tolerance == 0.0:
        return STRICT * term.weight * missing + (missing > 0.0)
    return (missing / term.tolerance) ** 2
