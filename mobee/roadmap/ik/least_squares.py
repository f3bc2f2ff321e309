"""Damped least squares with restarts, for the terms that have a derivative; what the others say of it is looked at afterwards."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from types import ModuleType

import numpy as np

from mobee.engine.pack import Flags, Packed, pack
from mobee.roadmap.ik.needed import needed
from mobee.roadmap.ik.problem import Problem
from mobee.roadmap.ik.term import Aim
from mobee.robot.per_robot import per_robot
from mobee.robot.robot import Array, Robot

RESTARTS, AT_ONCE = 40, 4
STEPS = 60  # of one start at most
NEAR = 0.15  # of the motors' ranges: standard deviation of every second restart about the start; the others are anywhere
_EXACT = 1e-6  # m or rad, for a term that is without tolerance


class Descent:
    """Least squares of a problem's aims, and of others besides, from any starts; the others' goals may differ from start to start."""

    def __init__(self, problem: Problem, besides: Sequence[tuple[Aim, float]] = ()) -> None:
        robot = problem.model.robot
        pairs = [(aim, one.tolerance) for one in problem.terms if one.aims is not None for aim in one.aims(robot)]
        self._own = aim_reals(pairs)
        pairs += besides
        self.count = len(pairs)
        self._aims = [aim for aim, _ in pairs]
        self._numbers = np.array(
            [number for aim, _ in pairs for number in (aim.kind, aim.first_link, aim.second_link, aim.motor)], dtype=np.int64
        )
        self._reals = aim_reals(pairs)[None]
        self._enough = np.array([np.inf if tolerance is None else tolerance for _, tolerance in pairs])
        self._packed = _packed(robot)
        self._problem = problem
        self._low, self._high = (np.ascontiguousarray(side) for side in problem.limits.T)

    @cached_property
    def drawn(self) -> Flags:
        """Which of the motors that may move (d,) are to be random in a random start, see `needed`."""
        return needed(self._problem, self._aims)

    def run(self, q: Array, goals: Array | None = None) -> Array:
        """Where poses q (B, n), within the limits, lead to that meet every aim, (K, n); goals: as of `ends`."""
        ends, met = self.met(q, goals)
        return ends[met]

    def met(self, q: Array, goals: Array | None = None) -> tuple[Array, Flags]:
        """Where poses q (B, n), within the limits, lead to, (B, n), and which of them meet every aim, (B,); goals: as of `ends`."""
        ends, residuals = self.ends(q, goals)
        met: Flags = (residuals > self._enough).sum(axis=1) == 0
        return ends, met

    def ends(self, q: Array, goals: Array | None = None) -> tuple[Array, Array]:
        """Where poses q (B, n), within the limits, lead to, (B, n), and what every aim misses there, (B, aims) m or rad.

        `goals`: what the aims besides the problem's own are to be at each start, (B, reals of those), see `aim_reals`; None: as given.
        """
        ends = q.copy()
        reals = self._reals if goals is None else np.concatenate([np.repeat(self._own[None], len(goals), axis=0), goals], axis=1)
        evaluations, residuals = _compiled().descend(
            self._packed.integers, self._packed.floats, self._numbers, reals, self._problem.free, self._low, self._high, STEPS, ends
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
        # What no term asks for stays at the start as long as that will do; then it may be what touches, as a thumb above a table.
        which = descent.drawn if left > RESTARTS // 2 else np.ones_like(descent.drawn)
        starts = problem.whole(_drawn(problem, rng, min(AT_ONCE, left), which))
        left -= AT_ONCE


def _drawn(problem: Problem, rng: np.random.Generator, count: int, which: Flags) -> Array:
    """Starts of the free motors (count, d), in turn anywhere and about the start; some motors (d,) alone, the others stay there."""
    low, high = problem.limits.T
    start = problem.start[problem.free]
    drawn = rng.uniform(low, high, (count, len(low)))
    about = start + NEAR * (high - low) * rng.standard_normal((count, len(low)))
    drawn[::2] = np.clip(about[::2], low, high)
    drawn[:, ~which] = start[~which]
    return drawn


def aim_reals(aims: Sequence[tuple[Aim, float | None]]) -> Array:
    """All that compiled code wants to know of aims in real numbers, one after the other; with how much each may miss."""
    return np.concatenate([_reals(aim, tolerance) for aim, tolerance in aims]) if aims else np.empty(0)


def _reals(aim: Aim, tolerance: float | None) -> Array:
    first, second = aim.first_frame.ravel(), aim.second_frame.ravel()
    return np.concatenate([aim.first_point, first, aim.second_point, second, [aim.length, tolerance or _EXACT]])


@per_robot
def _packed(robot: Robot) -> Packed:
    return pack(robot)


def _compiled() -> ModuleType:
    from mobee.engine.load import load_only

    return load_only("mobee.engine.descent")
