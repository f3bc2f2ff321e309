"""Rivals on the same cost: the thesis' (3.1.1) CMA-ES, simulated annealing, particle filter, and xNES.  Each ends at a good pose."""

from __future__ import annotations

import numpy as np

from experiments.bench.cma_peer import CmaStrategy
from mobee.arrays import Array
from mobee.roadmap.evolution.search import Restart, Search
from mobee.roadmap.ik.ngik import STD
from mobee.roadmap.ik.problem import Problem

COOLING = 4000  # poses of one annealing
HOT, COLD = 1.0, 0.003  # its temperatures, in units of the cost
WIDE, NARROW = 0.2, 0.01  # of the ranges: its steps, and the particles' noise
PARTICLES, SELECTIVE = 200, 4.0  # the share of a particle falls e-fold with 1/4 of the costs' deviation
SHRINKING = 0.93  # of the noise, each time
PATIENCE = 400  # generations of xNES without gain, ten times those of ours: it is slower


def xnes(problem: Problem, seed: int, most: int) -> Array | None:
    """NES as published (Glasmachers 2010), with its default population, in our box and with our restarts."""
    low, high = problem.limits.T
    start, restart = problem.start[problem.free], Restart(patience=PATIENCE)
    search = Search(start, STD * (high - low), problem.limits, restart, method="xnes", seed=seed)
    while problem.evaluations < most:
        q = problem.whole(search.ask())
        costs, good = problem.look(q)
        if good.any():
            found: Array = q[int(good.argmax())]
            return found
        search.tell(costs)
    return None


def cma(problem: Problem, seed: int, most: int, batched: bool) -> Array | None:
    """CMA-ES with its default population, anew from a random posture where it has stopped by itself; poses one by one or a generation."""
    rng = np.random.default_rng(seed)
    start = _units(problem, problem.start[problem.free])
    strategy = CmaStrategy(start, STD, seed, limits=(0.0, 1.0))
    while problem.evaluations < most:
        samples = strategy.ask()
        q = _poses(problem, samples)
        looks = [problem.look(q)] if batched else [problem.look(one[None]) for one in q]
        costs, good = (np.concatenate(part) for part in zip(*looks, strict=True))
        if good.any():
            found: Array = q[int(good.argmax())]
            return found
        strategy.tell(costs)
        if strategy.stopped:
            strategy = CmaStrategy(rng.uniform(size=len(start)), STD, int(rng.integers(1 << 30)), limits=(0.0, 1.0))
    return None


def annealing(problem: Problem, seed: int, most: int) -> Array | None:
    """Simulated annealing: one pose at a time, steps and temperature fall together, then anew from the best."""
    rng = np.random.default_rng(seed)
    best = here = _units(problem, problem.start[problem.free])
    cost = least = np.inf
    while problem.evaluations < most:
        done = problem.evaluations % COOLING / COOLING
        if done == 0.0:
            here, cost = best, least
        step = WIDE * (NARROW / WIDE) ** done * rng.standard_normal(len(here))
        there = np.clip(here + step, 0.0, 1.0)
        q = _poses(problem, there[None])
        costs, good = problem.look(q)
        if good[0]:
            return q[0]
        if costs[0] < cost or rng.uniform() < np.exp((cost - costs[0]) / (HOT * (COLD / HOT) ** done)):
            here, cost = there, float(costs[0])
            if cost < least:
                best, least = here, cost
    return None


def particles(problem: Problem, seed: int, most: int) -> Array | None:
    """A particle filter: draw particles anew by their costs, move each a little, less every time; then anew from everywhere."""
    rng = np.random.default_rng(seed)
    noise, places = 0.0, rng.uniform(size=(PARTICLES, len(problem.free)))
    while problem.evaluations < most:
        q = _poses(problem, places)
        costs, good = problem.look(q)
        if good.any():
            found: Array = q[int(good.argmax())]
            return found
        noise = WIDE if noise == 0.0 else noise * SHRINKING
        if noise < NARROW / 10.0:
            noise, places = 0.0, rng.uniform(size=places.shape)
            continue
        shares = np.exp(-SELECTIVE * (costs - costs.min()) / max(float(costs.std()), 1e-9))
        drawn = rng.choice(PARTICLES, PARTICLES, p=shares / shares.sum())
        places = np.clip(places[drawn] + noise * rng.standard_normal(places.shape), 0.0, 1.0)
    return None


def _units(problem: Problem, q: Array) -> Array:
    low, high = problem.limits.T
    units: Array = (q - low) / (high - low)
    return units


def _poses(problem: Problem, units: Array) -> Array:
    low, high = problem.limits.T
    return problem.whole(np.clip(low + units * (high - low), low, high))
