# SPDX-License-Identifier: Apache-2.0
"""Natural gradient inverse kinematics: finds a pose that minimises a sum of costs (thesis 3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array
from mobee.errors import InvalidValue, UnknownName
from mobee.model.contact import Contact, ContactTable
from mobee.model.model import Model
from mobee.roadmap.evolution.search import Restart, Search
from mobee.roadmap.ik.least_squares import least_squares
from mobee.roadmap.ik.problem import Cost, Problem

METHODS = ("hybrid", "nes", "least_squares")
EVALUATIONS = 20_000
STD = 0.2  # of every motor's range
POPULATION = 20


@dataclass(frozen=True, slots=True, eq=False)
class IK:
    """The result of `solve_ik`.

    `q`: (n,) rad, the pose. `reached`: whether the residuals of all terms that have a tolerance are within it. `residuals`: residual of
    each term, by the term's name. `evaluations`: number of poses that the search evaluated. `table`: all contacts of the pose, also those
    of fields (larger shapes that cause repulsive forces). As in the search, `reached` and `residuals` depend on contacts of solids only;
    for `table`, q is evaluated again with all contacts.
    """

    q: Array
    reached: bool
    residuals: dict[str, float]
    evaluations: int
    table: ContactTable

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The contacts between solids in the pose, without those of fields (larger shapes that cause repulsive forces)."""
        return tuple(contact for contact in self.table.contacts() if contact.kind == "solid")


def solve_ik(
    model: Model,
    costs: Sequence[Cost],
    start: ArrayLike | None = None,
    seed: int = 0,
    motors: Sequence[str] | None = None,
    method: Literal["hybrid", "nes", "least_squares"] = "hybrid",
    evaluations: int = EVALUATIONS,
) -> IK:
    """Find a pose whose terms are all within their tolerances, or else the pose with the lowest cost found (thesis eq. 3.1).

    The search ends with the first pose within all tolerances.  If no term has a tolerance, it ends when it has converged. With the method
    "least_squares", the start is returned if no pose within all tolerances was found.

    Args:
        model: robot and world; only contacts of solids count.
        costs: terms of mobee.costs, and plain functions of pose and contacts, as `mobee.costs.term` takes them.
        start: (n,) rad, where the search begins, and the posture of the motors that may not move; None: home.
        seed: of the random numbers.
        motors: names of parts and motors that may move; None: all.
        method: "nes": by an evolution strategy, for all terms; "least_squares": damped least squares with restarts on the terms that have a
            derivative, accepted if the others are within their tolerances; "hybrid": least squares, then "nes" if it fails.
        evaluations: largest number of poses that the evolution strategy evaluates.

    Raises:
        InvalidValue, UnknownName: an argument is not valid; the message states the valid values.
    """
    if method not in METHODS:
        raise UnknownName("method", method, METHODS)
    if evaluations < POPULATION:
        raise InvalidValue(f"evaluations {evaluations}: must be at least {POPULATION}, one generation.")
    problem = Problem(model, costs, start, motors)
    rng = np.random.default_rng(seed)
    q = None if method == "nes" else least_squares(problem, rng)
    if q is None:
        q = problem.start if method == "least_squares" else _evolved(problem, rng, problem.evaluations + evaluations)
    return _result(model, problem, q)


def _evolved(problem: Problem, rng: np.random.Generator, most: int) -> Array:
    """Return the first pose found within all tolerances, or else the cheapest of all evaluated poses."""
    start = problem.start[problem.free]
    costs, good = problem.evaluate(problem.start[None])
    if good[0] and problem.must:
        return problem.start
    low, high = problem.limits.T
    search = Search(start, STD * (high - low), problem.limits, Restart(), POPULATION, seed=rng)
    while problem.evaluations + POPULATION <= most and (problem.must or search.starts == 1):
        q = problem.whole(search.ask())
        costs, good = problem.evaluate(q)
        if problem.must and good.any():
            found: Array = q[int(np.where(good, costs, np.inf).argmin())]
            return found
        search.tell(costs)
    best: Array = problem.whole(search.best[None])[0]
    return best


def _result(model: Model, problem: Problem, q: Array) -> IK:
    """Return the result for q: the costs from an evaluation with solids only, as in the search, and all contacts."""
    pose = problem.model.evaluate(q[None])
    missing = {name: float(one.residual(pose)[0]) for name, one in problem.by_name.items()}
    reached = all(one.tolerance is None or missing[name] <= one.tolerance for name, one in problem.by_name.items())
    return IK(q, reached, missing, problem.evaluations, model.evaluate(q[None]).table)
