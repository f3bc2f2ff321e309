"""Who solves targets of inverse kinematics, each called alike: the library, mink, the thesis' rivals."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

import mobee
from experiments.bench.ik_rivals import annealing, cma, particles, xnes
from experiments.bench.ik_workload import MOTORS, Target
from experiments.bench.mink_peer import MinkPeer
from mobee.roadmap.ik.problem import Problem
from mobee.robot.robot import Array, Ints

MOST = 20_000  # evaluations of a rival
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


@dataclass(frozen=True, slots=True, eq=False)
class Tries:
    """What came of targets: whether each was reached, its evaluations and its processor time [ms], (T,); failures as they are."""

    reached: Array
    evaluations: Ints
    ms: Array


def tried(solve: Solve, aims: Sequence[Target], seed: int = 0) -> Tries:
    """Every target once, each with a seed of its own."""
    solve(aims[0], seed)  # caches and lazy set-up
    reached, evaluations, ms = [], [], []
    for number, aim in enumerate(aims, seed):
        start = time.process_time()
        done, looked = solve(aim, number)
        ms.append(1e3 * (time.process_time() - start))
        reached.append(done)
        evaluations.append(looked)
    return Tries(np.array(reached), np.array(evaluations), np.array(ms))
