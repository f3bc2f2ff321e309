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
    """The pose that was found.

    `q`: (n,) rad.  `reached`: every term is within its tolerance, by another evaluation of q.  `residuals`: what each term misses, by
    its name.  `evaluations`: how many poses were looked at.  `table`: all its contacts, those of fields too.
    """

    q: Array
    reached: bool
    residuals: dict[str, float]
    evaluations: int
    table: ContactTable

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The solid contacts of the pose."""
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
    """A pose whose terms are all within their tolerances, or the cheapest of those looked at (thesis eq. 3.1).

    The search ends with the first pose that is good enough.  Where no term has a tolerance it goes on until it has converged.

    Args:
        model: whose solids are felt, in its world as it is now.
        costs: terms of mobee.costs, and plain functions of pose and contacts, see mobee.costs.term.
        start: (n,) rad, where the search begins, and what the motors that may not move keep; None: home.
        seed: of all that is drawn.
        motors: names of parts and motors that may move; None: all.
        method: "nes": by an evolution strategy, whatever the terms are; "least_squares": damped least squares with restarts on the terms
            that have a derivative, accepted where the others agree; "hybrid": least squares, and what it misses by evolution.
        evaluations: how many poses the evolution strategy may look at.

    Raises:
        InvalidValue, UnknownName: with what is valid.
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
    """The first generation's best that is within all tolerances; else the cheapest of all poses looked at."""
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
    """Told by another evaluation, of the whole model."""
    pose = model.evaluate(q[None])
    missing = {name: float(one.residual(pose)[0]) for name, one in problem.by_name.items()}
    reached = all(one.tolerance is None or missing[name] <= one.tolerance for name, one in problem.by_name.items())
    return IK(q, reached, missing, problem.evaluations, pose.table)
