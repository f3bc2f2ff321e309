"""Who solves targets of inverse kinematics, each called alike: the library, mink, the thesis' rivals."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import mobee
from experiments.bench.calibration import Calibration
from experiments.bench.ik_rivals import annealing, cma, particles, xnes
from experiments.bench.ik_workload import MOTORS, Target
from experiments.bench.mink_peer import MinkPeer
from mobee.arrays import Array
from mobee.roadmap.ik.problem import Problem

MOST = 20_000  # evaluations of a rival
IN_TURN = 20  # targets of one solver, before it is another's turn: fewer would measure cold caches
CMA, CMA_BATCHED = "CMA-ES, pose by pose", "CMA-ES, a generation at once"
ANNEALING, PARTICLES, XNES = "simulated annealing", "particle filter", "xNES, as published"
RIVALS: dict[str, Callable[[Problem, int, int], Array | None]] = {
    CMA: lambda problem, seed, most: cma(problem, seed, most, batched=False),
    CMA_BATCHED: lambda problem, seed, most: cma(problem, seed, most, batched=True),
    ANNEALING: annealing,
    PARTICLES: particles,
    XNES: xnes,
}
Solve = Callable[[Target, int], tuple[bool, int]]  # of a target and a seed: whether it was reached, and evaluations
Motors = Sequence[str] | None  # that may move; None: all


def library(model: mobee.Model, method: Literal["hybrid", "nes"], motors: Motors) -> Solve:
    """`mobee.solve_ik`."""

    def solve(aim: Target, seed: int) -> tuple[bool, int]:
        ik = mobee.solve_ik(model, aim.costs(), seed=seed, motors=motors, method=method, evaluations=MOST)
        return ik.reached, ik.evaluations

    return solve


def rival(model: mobee.Model, name: str, motors: Motors) -> Solve:
    """One of RIVALS."""

    def solve(aim: Target, seed: int) -> tuple[bool, int]:
        problem = Problem(model, aim.costs(), None, motors)
        return RIVALS[name](problem, seed, MOST) is not None, problem.evaluations

    return solve


def mink(model: mobee.Model) -> Solve:
    """The peer, on torso and arm; raises MinkMissing and MujocoMissing."""
    peer = MinkPeer(model.robot)

    def solve(aim: Target, seed: int) -> tuple[bool, int]:
        problem = Problem(model, aim.costs(), None, MOTORS)
        return peer.solve(problem, aim, seed, MOST) is not None, problem.evaluations

    return solve


def timed(solve: Solve, aim: Target, seed: int) -> tuple[bool, int, float]:
    """Whether a target was reached, after how many evaluations and ms of processor time."""
    start = time.process_time()
    return *solve(aim, seed), 1e3 * (time.process_time() - start)


@dataclass(slots=True)
class Tries:
    """What came of targets, in order: whether each was reached, its evaluations and its processor time, failures as they are."""

    reached: list[bool] = field(default_factory=list)
    evaluations: list[int] = field(default_factory=list)
    ms: list[float] = field(default_factory=list)
    standard_ms: list[float] = field(default_factory=list)  # on the standard machine, see calibration.py

    def add(self, solve: Solve, aim: Target, seed: int, speeds: Calibration) -> None:
        """One target more."""
        (reached, evaluations, ms), speed = speeds.around(lambda: timed(solve, aim, seed))
        self.reached.append(reached)
        self.evaluations.append(evaluations)
        self.ms.append(ms)
        self.standard_ms.append(ms * speed)


@dataclass(frozen=True, slots=True)
class Entrant:
    """A solver and the targets that it is given."""

    solve: Solve
    aims: Sequence[Target]


def tried(entrants: Mapping[str, Entrant], speeds: Calibration, tell: Callable[[int, str], None]) -> dict[str, Tries]:
    """All targets, some to each solver in turn, so that a slow minute of the machine hits everyone; `tell` hears how far it is."""
    for one in entrants.values():
        one.solve(one.aims[0], 0)  # caches and lazy set-up
    found = {name: Tries() for name in entrants}
    for begin in range(0, max(len(one.aims) for one in entrants.values()), IN_TURN):
        for name, one in entrants.items():
            tell(begin, name)
            for seed, aim in enumerate(one.aims[begin : begin + IN_TURN], begin):
                found[name].add(one.solve, aim, seed, speeds)
    return found
