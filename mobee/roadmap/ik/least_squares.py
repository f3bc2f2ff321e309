# SPDX-License-Identifier: Apache-2.0
"""Damped least squares with restarts for the terms of a pose's cost that have a derivative; the other terms are checked afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from mobee.arrays import Array, Ints, checked_threads
from mobee.errors import InvalidValue
from mobee.roadmap.ik.problem import Flags, Problem, needed
from mobee.roadmap.ik.terms import KINDS, Aim
from mobee.robot.robot import Robot

RESTARTS, AT_ONCE = 40, 4
STEPS = 60  # of one start at most
NEAR = 0.15  # of the motors' ranges: standard deviation of every second restart about the start; the others are uniform
REALS = 26  # of an aim, see `aim_reals`
_EXACT = 1e-6  # m or rad, for a term without a tolerance


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

        `goals`: (B, 26 k): row i is what `aim_reals` returns for the k additional aims of start i. They replace the k aims `besides` of the
        class, and must have the same kinds, links and motors, in the same order. None: the aims `besides` are used for all starts.
        """
        ends, met = self.met(q, goals)
        return ends[met]

    def met(self, q: Array, goals: Array | None = None) -> tuple[Array, Flags]:
        """Return the solutions (B, n) rad found from the starts q (B, n) rad, and whether each is within the tolerances of all aims, (B,).

        `goals`: (B, 26 k): row i is what `aim_reals` returns for the k additional aims of start i. They replace the k aims `besides` of the
        class, and must have the same kinds, links and motors, in the same order. None: the aims `besides` are used for all starts.
        """
        ends, residuals = self.ends(q, goals)
        met: Flags = (residuals > self._enough).sum(axis=1) == 0
        return ends, met

    def ends(self, q: Array, goals: Array | None = None) -> tuple[Array, Array]:
        """Return the solutions (B, n) rad found from the starts q (B, n) rad, and the residuals of all aims there, (B, aims), m or rad.

        `goals`: (B, 26 k): row i is what `aim_reals` returns for the k additional aims of start i. They replace the k aims `besides` of the
        class, and must have the same kinds, links and motors, in the same order. None: the aims `besides` are used for all starts.
        The columns of the residuals are the aims of the problem's terms, then the additional aims. The number of evaluated poses is added
        to `problem.evaluations`.
        """
        from mobee._core.least_squares import descend  # loads the core, so it is imported only when needed
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
    """Draw starts of the free motors (count, d), alternately around the start and anywhere; only of some motors (d,)."""
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
    """Return kind, links and motor of each aim, (K, 4)."""
    found = [(aim.kind, aim.first_link, aim.second_link, aim.motor) for aim in aims]
    valid = len(KINDS), len(robot.links), len(robot.links), len(robot.motors)
    for one in found:
        if not all(0 <= number < count for number, count in zip(one, valid, strict=True)):
            raise InvalidValue(f"an aim of kind {one[0]} has links {one[1]} and {one[2]} and motor {one[3]}; there are fewer of them.")
    return np.array(found, dtype=np.int64).reshape(-1, 4)
