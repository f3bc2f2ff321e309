"""How many evaluations evolution strategies need: ours beside CMA-ES on rotated functions, from the same starts."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.bench.cma_peer import CmaStrategy, load_cma
from experiments.progress import Progress
from mobee.roadmap.nes import NES
from mobee.robot.robot import Array

TARGET, STD = 1e-8, 0.5
MOST = 400_000  # evaluations, far beyond what any of them needs
REQUIRED, BOUND = "evaluations over those of CMA-ES, median of the rows", 1.05
PUBLISHED = 10  # dimensions up to which the published form is run too

FUNCTIONS: dict[str, Callable[[Array], Array]] = {
    "sphere": lambda y: (y**2).sum(axis=1),
    "ellipsoid 1e6": lambda y: (y**2) @ 10.0 ** (6.0 * np.arange(y.shape[1]) / (y.shape[1] - 1)),
    "cigar 1e6": lambda y: y[:, 0] ** 2 + 1e6 * (y[:, 1:] ** 2).sum(axis=1),
    "Rosenbrock": lambda y: (100.0 * (y[:, 1:] - y[:, :-1] ** 2) ** 2 + (1.0 - y[:, :-1]) ** 2).sum(axis=1),
}


@dataclass(frozen=True, slots=True)
class Settings:
    """How much is run."""

    dimensions: tuple[int, ...] = (10, 20, 41)
    runs: int = 11


QUICK = Settings(dimensions=(10,), runs=3)


def measure(settings: Settings) -> dict[str, Any]:
    """All numbers, for people and scripts; raises CmaMissing."""
    load_cma()
    rows = [(name, d) for d in settings.dimensions for name in FUNCTIONS]
    found = []
    with Progress() as progress:
        for number, (name, d) in enumerate(rows):
            progress.show(number / len(rows), f"{name}, {d} dimensions")
            found.append(_row(name, d, settings.runs))
    ratio = float(np.median([row["ratio"] for row in found]))
    requirement = {
        "name": "evaluations over those of CMA-ES, median of the rows",
        "found": ratio,
        "at_most": BOUND,
        "passed": ratio <= BOUND,
    }
    return {"target": TARGET, "std": STD, "runs": settings.runs, "rows": found, "requirements": [requirement], "passed": ratio <= BOUND}


def _row(name: str, d: int, runs: int) -> dict[str, Any]:
    """Median evaluations of every strategy, infinite where it mostly fails, and the time of its own that one takes."""
    makers: dict[str, Callable[[Array, int], Any]] = {
        "nes": lambda start, seed: NES(start, STD, seed=seed),
        "cma": lambda start, seed: CmaStrategy(start, STD, seed),
    }
    if d <= PUBLISHED:
        makers["xnes"] = lambda start, seed: NES(start, STD, method="xnes", seed=seed)
    row: dict[str, Any] = {"function": name, "dimensions": d}
    for key, make in makers.items():
        results = [_run(name, d, seed, make) for seed in range(runs)]
        row[key] = float(np.median([evaluations for evaluations, _ in results]))
        row[f"{key}_us"] = float(np.median([us for _, us in results]))
    row["ratio"] = row["nes"] / row["cma"]
    return row


def _run(name: str, d: int, seed: int, make: Callable[[Array, int], Any]) -> tuple[float, float]:
    """Evaluations until one costs less than the target, and processor time of an evaluation without the function's, us."""
    rng = np.random.default_rng((seed, d))
    rotation = np.linalg.qr(rng.standard_normal((d, d)))[0]
    function = FUNCTIONS[name]
    strategy = make(rng.uniform(-1.0, 1.0, d), seed)
    evaluations, own = 0, 0.0
    while evaluations < MOST:
        start = time.process_time()
        samples = strategy.ask()
        own += time.process_time() - start
        costs = function(np.asarray(samples) @ rotation)
        evaluations += len(samples)
        if costs.min() < TARGET:
            return evaluations, 1e6 * own / evaluations
        start = time.process_time()
        strategy.tell(costs)
        own += time.process_time() - start
    return np.inf, 1e6 * own / evaluations


def report(result: dict[str, Any]) -> str:
    """The measurements as text."""
    lines = [
        f"Evaluations until f < {result['target']:g}, start in [-1, 1], standard deviation {result['std']}, rotated,",
        f"medians of {result['runs']} runs; in brackets processor time of its own, us an evaluation:",
        f"  {'':<14}{'d':>3}{'NES':>18}{'CMA-ES':>18}{'ratio':>7}{'xNES':>8}",
    ]
    for row in result["rows"]:
        ours, theirs = (f"{row[key]:.0f} ({row[f'{key}_us']:.1f})" for key in ("nes", "cma"))
        published = f"{row['xnes']:>8.0f}" if "xnes" in row else ""
        lines.append(f"  {row['function']:<14}{row['dimensions']:>3}{ours:>18}{theirs:>18}{row['ratio']:>7.2f}{published}")
    for one in result["requirements"]:
        lines.append(f"{one['name']}: {one['found']:.3f} <= {one['at_most']} {'pass' if one['passed'] else 'SHORT'}")
    return "\n".join(lines)
