# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics: finds a pose with a small sum of costs by least squares, by natural evolution strategies or by both (thesis 3.2).

Damped least squares with restarts is for the terms of the cost that have a derivative; the other terms are checked afterwards.
`nearest_posture` finds the posture that brings a marker nearest to a position that it may not reach.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, Ints, checked_seed, checked_threads
from mobee.errors import InvalidValue, UnknownName
from mobee.model.contact import Contact, ContactTable, links_moved
from mobee.model.model import Model
from mobee.model.world import World
from mobee.model.world_object import sphere
from mobee.roadmap.evolution.search import Restart, Search
from mobee.roadmap.ik.costs import position as position_cost
from mobee.roadmap.ik.problem import Cost, Flags, Problem, needed
from mobee.roadmap.ik.terms import KINDS, Aim
from mobee.robot.robot import Robot

METHODS = ("hybrid", "nes", "least_squares")
EVALUATIONS = 20_000
STD = 0.2  # of every motor's range
POPULATION = 20

RESTARTS, AT_ONCE = 40, 4
STEPS = 60  # of one start at most
NEAR = 0.15  # of the motors' ranges: standard deviation of every second restart about the start; the others are uniform
REALS = 26  # of an aim, see `aim_reals`
_EXACT = 1e-6  # m or rad, for a term without a tolerance

POINT = 1e-3  # m, radius of the sphere that represents a point
SHELL, FAR = 0.02, 0.5  # m, of `nearest_outside`: steps of the distance, and the largest distance
MET = 1e-4  # m: a smaller distance counts as 0
STARTS = 23  # random start postures of `nearest_posture`


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
    if not evaluations >= POPULATION:
        raise InvalidValue(f"evaluations {evaluations}: must be at least {POPULATION}, one generation.")
    problem = Problem(model, costs, start, motors)
    rng = np.random.default_rng(checked_seed(seed))
    q = None if method == "nes" else least_squares(problem, rng)
    if q is None:
        q = problem.start if method == "least_squares" else _evolved(problem, rng, problem.evaluations + evaluations)
    return _result(model, problem, q)


def _evolved(problem: Problem, rng: np.random.Generator, most: int) -> Array:
    """Return the first pose found within all tolerances, or else the cheapest of all evaluated poses; `most`: limit of evaluations."""
    start = problem.start[problem.free]
    costs, good = problem.evaluate(problem.start[None])
    if good[0] and problem.must:
        return problem.start
    low, high = problem.limits.T
    search = Search(start, STD * (high - low), problem.limits, Restart(), POPULATION, seed=rng)
    search.best, search.best_cost = start.copy(), float(costs[0])
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
    """Return the result of inverse kinematics for the posture q (n,) rad.

    The residuals are computed as in the search, in which only solids are tested for contacts. The table of contacts has all contacts.
    """
    pose = problem.model.evaluate(q[None])
    missing = {name: float(one.residual(pose)[0]) for name, one in problem.by_name.items()}
    reached = all(one.tolerance is None or missing[name] <= one.tolerance for name, one in problem.by_name.items())
    return IK(q, reached, missing, problem.evaluations, model.evaluate(q[None]).table)


class Descent:
    """Damped least squares on the aims (residuals) of a problem, from many start poses.

    Args:
        problem: a search for a pose whose cost is a sum of terms. The aims of the terms with derivatives are minimised; the motors that may
            move are changed, within their limits.
        besides: additional aims with their tolerances, for example of task coordinates. If the goals of these aims differ between the
            starts, they are given to the methods as the argument `goals`.
        threads: number of threads that share the starts; the results do not depend on it.
    """

    def __init__(self, problem: Problem, besides: Sequence[tuple[Aim, float]] = (), threads: int = 1) -> None:
        robot = problem.model.robot
        pairs = [(aim, one.tolerance) for one in problem.terms if one.aims is not None for aim in one.aims(robot)]
        self._own = aim_reals(pairs)
        pairs += besides
        self.count = len(pairs)
        self._aims = [aim for aim, _ in pairs]
        self._numbers = _numbers(robot, self._aims)
        self._reals = aim_reals(pairs)[None]
        if self._reals.shape != (1, REALS * self.count) or not np.isfinite(self._reals).all():
            raise InvalidValue("an aim has points, frames or numbers that are not (3,), (3, 3) or (9,), and finite.")
        self._enough = np.array([np.inf if tolerance is None else tolerance for _, tolerance in pairs])
        self._problem, self._threads = problem, checked_threads(threads)
        self._limits = np.ascontiguousarray(problem.limits[:, 0]), np.ascontiguousarray(problem.limits[:, 1])

    @cached_property
    def drawn(self) -> Flags:
        """Which of the d motors that may move must have random positions in random start poses, (d,) booleans.

        These are the motors that affect an aim, or a term (except "collision") that has a tolerance but no derivative.
        """
        return needed(self._problem, self._aims)

    def run(self, q: Array, goals: Array | None = None) -> Array:
        """Search from the start poses q (B, n) rad; return only the K solutions whose residuals are all within the tolerances, (K, n) rad.

        `goals`: (B, 26 k), goals that differ between the starts. Row i describes k aims (residuals) for start i, as `aim_reals` returns
        them. They replace the k aims that the constructor got as `besides`, and must have the same kinds, links and motors, in the same
        order. None: the aims `besides` are used for all starts.
        """
        ends, met = self.met(q, goals)
        return ends[met]

    def met(self, q: Array, goals: Array | None = None) -> tuple[Array, Flags]:
        """Return the solutions (B, n) rad found from the starts q (B, n) rad, and whether each is within the tolerances of all aims, (B,).

        `goals`: (B, 26 k), goals that differ between the starts. Row i describes k aims (residuals) for start i, as `aim_reals` returns
        them. They replace the k aims that the constructor got as `besides`, and must have the same kinds, links and motors, in the same
        order. None: the aims `besides` are used for all starts.
        """
        ends, residuals = self.ends(q, goals)
        met: Flags = (residuals > self._enough).sum(axis=1) == 0
        return ends, met

    def ends(self, q: Array, goals: Array | None = None) -> tuple[Array, Array]:
        """Return the solutions (B, n) rad found from the starts q (B, n) rad, and the residuals of all aims there, (B, aims), m or rad.

        `goals`: (B, 26 k), goals that differ between the starts. Row i describes k aims (residuals) for start i, as `aim_reals` returns
        them. They replace the k aims that the constructor got as `besides`, and must have the same kinds, links and motors, in the same
        order. None: the aims `besides` are used for all starts.
        The columns of the residuals are the aims of the problem's terms, then the additional aims. The number of evaluated poses is added
        to `problem.evaluations`.
        """
        from mobee._core.roadmap import descend  # loads the core, so it is imported only when needed
        from mobee.model.engine import robot_handle

        robot = self._problem.model.robot
        ends = np.array(q, dtype=np.float64, order="C")
        reals = self._reals if goals is None else np.concatenate([np.repeat(self._own[None], len(goals), axis=0), goals], axis=1)
        if ends.ndim != 2 or ends.shape[1] != len(robot.motors) or reals.shape[1] != self._reals.shape[1] or len(reals) not in (1, len(q)):
            raise InvalidValue(f"starts of shape {ends.shape}, with goals {reals.shape}: give (B, {len(robot.motors)}), and a row of each.")
        free = np.asarray(self._problem.free, dtype=np.int64)
        evaluations, residuals = descend(robot_handle(robot), self._numbers, reals, free, self._limits, STEPS, ends, self._threads)
        self._problem.evaluations += evaluations
        return ends, residuals


def least_squares(problem: Problem, rng: np.random.Generator) -> Array | None:
    """Return a pose (n,) rad within the tolerances of all terms of a problem's cost; None if no such pose was found.

    The result is also None if no term has aims (residuals for least squares).
    The first start is the start pose of the problem; the other starts are random and are solved in groups. If several poses of one group
    are within all tolerances, the pose with the lowest cost is returned.
    """
    descent = Descent(problem)
    if not descent.count:
        return None
    starts, left = problem.start[None], RESTARTS
    while True:
        met = descent.run(starts)
        if len(met):
            costs, good = problem.evaluate(met)
            if good.any():
                found: Array = met[int(np.where(good, costs, np.inf).argmin())]
                return found
        if left <= 0:
            return None
        # Motors that affect no term stay at the start at first; later they move too, since they may cause contacts, as a thumb does.
        which = descent.drawn if left > RESTARTS // 2 else np.ones_like(descent.drawn)
        starts = problem.whole(_drawn(problem, rng, min(AT_ONCE, left), which))
        left -= AT_ONCE


def _drawn(problem: Problem, rng: np.random.Generator, count: int, which: Flags) -> Array:
    """Draw starting values of the d free motors for least squares, (count, d) rad: alternately near `problem.start` and in the whole range.

    `which`: (d,) whether each motor is drawn; the others have their value of `problem.start`.
    """
    low, high = problem.limits.T
    start = problem.start[problem.free]
    drawn = rng.uniform(low, high, (count, len(low)))
    about = start + NEAR * (high - low) * rng.standard_normal((count, len(low)))
    drawn[::2] = np.clip(about[::2], low, high)
    drawn[:, ~which] = start[~which]
    return drawn


def aim_reals(aims: Sequence[tuple[Aim, float | None]]) -> Array:
    """Return the points, frames, lengths and tolerances of aims (residuals) as the compiled core reads them, 26 numbers for each aim.

    `aims`: pairs of an aim and its tolerance [m or rad]; None: no tolerance. The result has the shape (26 * number of aims,).
    """
    return np.concatenate([_reals(aim, tolerance) for aim, tolerance in aims]) if aims else np.empty(0)


def _reals(aim: Aim, tolerance: float | None) -> Array:
    first, second = aim.first_frame.ravel(), aim.second_frame.ravel()
    return np.concatenate([aim.first_point, first, aim.second_point, second, [aim.length, tolerance or _EXACT]])


def _numbers(robot: Robot, aims: Sequence[Aim]) -> Ints:
    """Return kind, first link, second link and motor of each of K aims (residuals of inverse kinematics), as integers (K, 4).

    Raises InvalidValue if one of these numbers does not exist in this robot.
    """
    found = [(aim.kind, aim.first_link, aim.second_link, aim.motor) for aim in aims]
    valid = len(KINDS), len(robot.links), len(robot.links), len(robot.motors)
    for one in found:
        if not all(0 <= number < count for number, count in zip(one, valid, strict=True)):
            raise InvalidValue(f"an aim of kind {one[0]} has links {one[1]} and {one[2]} and motor {one[3]}; there are fewer of them.")
    return np.array(found, dtype=np.int64).reshape(-1, 4)


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """The posture that brings a marker nearest to a target.

    `q`: (n,) rad. `position`: (3,) m, root frame, of the marker in this posture. `distance`: of the marker from the target [m].
    """

    q: Array
    position: Array
    distance: float


def nearest_posture(model: Model, part: str, marker: str, position: Array, q: Array, seed: int = 0) -> Nearest:
    """Return the posture that brings the marker nearest to `position` (3,) m, root frame, with the motors of one part.

    The other motors stay as in q (n,) rad. The posture is found by least squares within the motors' limits, from q and from random
    postures; so it is the nearest posture with high probability, not with certainty. `seed`: of the random postures. Contacts are ignored.
    Raises InvalidValue if the part does not move the marker, or if `position` or q is not valid.
    """
    motors = [model.robot.motors[motor] for motor in _movers(model, part, marker)]
    problem = Problem(model, [position_cost(marker, position, tolerance=MET)], q, motors)
    low, high = problem.limits.T
    drawn = np.random.default_rng(seed).uniform(low, high, (STARTS, len(low)))
    ends, errors = Descent(problem).ends(np.concatenate([problem.start[None], problem.whole(drawn)]))
    best = int(errors[:, 0].argmin())
    return Nearest(ends[best], model.evaluate(ends[best]).position(marker), float(errors[best, 0]))


def body_at(model: Model, part: str, position: Array, q: Array) -> str | None:
    """Return the name of a link whose solid shapes contain `position` (3,) m, root frame, in the posture q (n,) rad; None if there is none.

    Links that the part moves are ignored.
    """
    robot, world = replace(model.robot, base_shapes=frozenset()), World()  # those shapes are tested too
    world.add("place", sphere(POINT), position=position)
    table = Model(robot, world).evaluate(q).table
    moved = links_moved(robot)[part]
    inside = [int(link) for link in table.first_link[(table.second_link < 0) & (table.kind == 0)] if int(link) not in moved]
    return robot.links[inside[0]] if inside else None


def nearest_outside(model: Model, part: str, marker: str, position: Array, q: Array) -> Array | None:
    """Return approximately the point (3,) m nearest to `position` that the marker can reach and that is outside the robot's body.

    The body is all solid shapes that `body_at` tests. The motors other than those of the part stay as in q (n,) rad. Points at distances up
    to 0.5 m from `position`, in steps of 2 cm, are tried; None if none of them is suitable. All points are in the root frame.
    """
    where = np.asarray(position, dtype=np.float64)
    directions = np.array([one for one in product((-1.0, 0.0, 1.0), repeat=3) if any(one)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    nearest = nearest_posture(model, part, marker, where, q).distance
    for distance in np.arange(max(nearest, SHELL), FAR, SHELL):
        for place in where + distance * directions:
            if body_at(model, part, place, q) is None and nearest_posture(model, part, marker, place, q).distance < SHELL:
                return np.asarray(place)
    return None


def _movers(model: Model, part: str, marker: str) -> Ints:
    """Return the part's motors that move the marker."""
    robot = model.robot
    where = robot.part(part)
    rows = np.abs(model.jacobian(np.stack([robot.home, robot.limits.mean(axis=1)]), marker)).max(axis=(0, 1))
    motors = where.start + np.flatnonzero(rows[where.slice] > 0.0)
    if not len(motors):
        able = [name for name in robot.markers if robot.markers[name].link in links_moved(robot)[part]]
        raise InvalidValue(f"{part} does not move the marker {marker!r}. Valid: {', '.join(able) or 'none'}.")
    return motors
