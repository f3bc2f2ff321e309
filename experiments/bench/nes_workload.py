"""What evolution strategies are measured on: rotated functions, each run from a start of its own until it is near enough to the optimum."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from experiments.bench.cma_peer import CmaStrategy
from mobee.arrays import Array
from mobee.roadmap.evolution.nes import NES

TARGET, STD = 1e-8, 0.5
MOST = 400_000  # evaluations, far beyond what any of them needs that comes to the target

FUNCTIONS: dict[str, Callable[[Array], Array]] = {
    "sphere": lambda y: (y**2).sum(axis=1),
    "ellipsoid 1e6": lambda y: (y**2) @ 10.0 ** (6.0 * np.arange(y.shape[1]) / (y.shape[1] - 1)),
    "cigar 1e6": lambda y: y[:, 0] ** 2 + 1e6 * (y[:, 1:] ** 2).sum(axis=1),
    "Rosenbrock": lambda y: (100.0 * (y[:, 1:] - y[:, :-1] ** 2) ** 2 + (1.0 - y[:, :-1]) ** 2).sum(axis=1),
}
STRATEGIES: dict[str, Callable[[Array, int], Any]] = {  # of a start and a seed
    "nes": lambda start, seed: NES(start, STD, seed=seed),
    "cma": lambda start, seed: CmaStrategy(start, STD, seed),
    "xnes": lambda start, seed: NES(start, STD, method="xnes", seed=seed),
    "snes": lambda start, seed: NES(start, STD, method="snes", seed=seed),
}


def trial(strategy: str, function: str, d: int, seed: int, most: int = MOST) -> tuple[float, float]:
    """Evaluations until one costs less than the target, inf for never, and processor time of one without the function's, us."""
    rng = np.random.default_rng((seed, d))
    rotation = np.linalg.qr(rng.standard_normal((d, d)))[0]
    cost = FUNCTIONS[function]
    search = STRATEGIES[strategy](rng.uniform(-1.0, 1.0, d), seed)
    evaluations, own = 0, 0.0
    while evaluations < most:
        start = time.process_time()
        samples = search.ask()
        own += time.process_time() - start
        costs = cost(np.asarray(samples) @ rotation)
        evaluations += len(samples)
        if costs.min() < TARGET:
            return evaluations, 1e6 * own / evaluations
        start = time.process_time()
        search.tell(costs)
        own += time.process_time() - start
    return np.inf, 1e6 * own / evaluations
