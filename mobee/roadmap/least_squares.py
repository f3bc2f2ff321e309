"""Damped least squares with restarts, for the terms that have a derivative; what the others say of it is looked at afterwards."""

from __future__ import annotations

from types import ModuleType

import numpy as np

from mobee.engine.pack import Packed, pack
from mobee.roadmap.problem import Problem
from mobee.roadmap.term import Aim
from mobee.robot.per_robot import per_robot
from mobee.robot.robot import Array, Robot

RESTARTS, AT_ONCE = 40, 4
STEPS = 60  # of one start at most
NEAR = 0.15  # of the motors' ranges: standard deviation of every second restart about the start; the others are anywhere
_EXACT = 1e-6  # m or rad, for a term that is without tolerance


class Descent:
    """Least squares of a problem's aims from any starts."""

    def __init__(self, problem: Problem) -> None:
        robot = problem.model.robot
        pairs = [(aim, one.tolerance) for one in problem.terms if one.aims is not None for aim in one.aims(robot)]
        self.count = len(pairs)
        self._numbers = np.array([number for aim, _ in pairs for number in (aim.kind, aim.first_link, aim.second_link)], dtype=np.int64)
        self._reals = np.concatenate([_reals(aim, tolerance) for aim, tolerance in pairs]) if pairs else np.empty(0)
        self._enough = np.array([np.inf if tolerance is None else tolerance for _, tolerance in pairs])
        self._packed = _packed(robot)
        self._problem = problem
        self._low, self._high = (np.ascontiguousarray(side) for side in problem.limits.T)

    def run(self, q: Array) -> Array:
        """Where poses q (B, n), within the limits, lead to that meet every aim, (K, n)."""
        ends, residuals = self.ends(q)
        met: Array = ends[(residuals <= self._enough).all(axis=1)]
        return met

    def ends(self, q: Array) -> tuple[Array, Array]:
        """Where poses q (B, n), within the limits, lead to, (B, n), and what every aim misses there, (B, aims) m or rad."""
        ends = q.copy()
        evaluations, residuals = _compiled().descend(
            self._packed.integers, self._packed.floats, self._numbers, self._reals, self._problem.free, self._low, self._high, STEPS, ends
        )
        self._problem.evaluations += evaluations
        return ends, residuals


def least_squares(problem: Problem, rng: np.random.Generator) -> Array | None:
    """A pose (n,) within all tolerances, the cheapest of those found at once; None where there are no aims, or none was found."""
    descent = Descent(problem)
    if not descent.count:
        return None
    starts, left = problem.start[None], RESTARTS
    while True:
        met = descent.run(starts)
        if len(met):
            costs, good = problem.look(met)
            if good.any():
                found: Array = met[int(np.where(good, costs, np.inf).argmin())]
                return found
        if left <= 0:
            return None
        starts = problem.whole(_drawn(problem, rng, min(AT_ONCE, left)))
        left -= AT_ONCE


def _drawn(problem: Problem, rng: np.random.Generator, count: int) -> Array:
    """Starts of the free motors (count, d), in turn anywhere and about the start."""
    low, high = problem.limits.T
    drawn = rng.uniform(low, high, (count, len(low)))
    about = problem.start[problem.free] + NEAR * (high - low) * rng.standard_normal((count, len(low)))
    drawn[::2] = np.clip(about[::2], low, high)
    return drawn


def _reals(aim: Aim, tolerance: float | None) -> Array:
    first, second = aim.first_frame.ravel(), aim.second_frame.ravel()
    return np.concatenate([aim.first_point, first, aim.second_point, second, [aim.length, tolerance or _EXACT]])


@per_robot
def _packed(robot: Robot) -> Packed:
    return pack(robot)


def _compiled() -> ModuleType:
    from mobee.engine.load import load_only

    return load_only("mobee.engine.descent")
