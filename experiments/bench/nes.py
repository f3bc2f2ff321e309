# SPDX-License-Identifier: Apache-2.0
"""Evolution strategies: number of evaluations that the library's NES and CMA-ES need on rotated functions, from the same starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from experiments.bench.peers import CmaStrategy, load_cma
from experiments.bench.timing import processor_time
from experiments.bench.verdicts import Requirement, report_text, verdict
from experiments.kit.command_line import Progress
from mobee.arrays import Array
from mobee.roadmap.evolution.nes import NES

TARGET, STD = 1e-8, 0.5  # cost at which a search has succeeded; first standard deviation
MAX_EVALUATIONS = 400_000  # far more than any search that succeeds needs
XNES_MAX_DIMENSIONS = 10  # up to which xNES as published is run too

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
REQUIREMENTS = (Requirement("evaluations over CMA-ES's, median of rows", ("ratio",), at_most=1.05),)


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.  `dimensions`: dimensions of the functions.  `runs`: runs of each strategy on each function."""

    dimensions: tuple[int, ...] = (10, 20, 41)
    runs: int = 11


QUICK = Settings(dimensions=(10,), runs=3)


def measure(settings: Settings) -> dict[str, Any]:
    """Run this benchmark and return its result; raises NotInstalled without cma.

    Main keys: "rows", a list with a dict for each function and number of dimensions; "ratio", the median of the rows' ratios;
    "requirements", a list with the dict that `Requirement.judge` returns for each requirement; "passed", whether all are met.

    Keys of a row: "function" and "dimensions"; for each strategy, such as "nes": under its name the median number of evaluations, and under
    its name with "_us" the strategy's own processor time per evaluation [us]; "ratio", evaluations of NES divided by those of CMA-ES.
    """
    load_cma()
    rows = [(name, d) for d in settings.dimensions for name in FUNCTIONS]
    found = []
    with Progress() as progress:
        for number, (name, d) in enumerate(rows):
            progress.show(number / len(rows), f"{name}, {d} dimensions")
            found.append(_row(name, d, settings.runs))
    ratio = float(np.median([row["ratio"] for row in found]))
    result = {"target": TARGET, "std": STD, "runs": settings.runs, "rows": found, "ratio": ratio}
    return result | verdict(result, REQUIREMENTS)


def _row(name: str, d: int, runs: int) -> dict[str, Any]:
    """Return the row of the function `name` in `d` dimensions; `measure` explains its keys.

    The values are medians over `runs` runs of each strategy.  The number of evaluations is inf if most runs of a strategy fail.
    """
    row: dict[str, Any] = {"function": name, "dimensions": d}
    for strategy in ("nes", "cma", "xnes") if d <= XNES_MAX_DIMENSIONS else ("nes", "cma"):
        results = [search(strategy, name, d, seed) for seed in range(runs)]
        row[strategy] = float(np.median([evaluations for evaluations, _ in results]))
        row[f"{strategy}_us"] = float(np.median([us for _, us in results]))
    row["ratio"] = row["nes"] / row["cma"]
    return row


def search(strategy: str, function: str, d: int, seed: int, most: int = MAX_EVALUATIONS) -> tuple[float, float]:
    """Search for the minimum of a rotated function with one strategy.

    `strategy`: a key of STRATEGIES.  `function`: a key of FUNCTIONS.  `d`: number of dimensions.  `seed`: seed of rotation, start and
    strategy. `most`: maximum number of evaluations.

    Returns the number of evaluations until a sample costs less than TARGET (1e-8), or inf if `most` do not suffice; and the strategy's own
    processor time per evaluation [us], without the time of the function.
    """
    rng = np.random.default_rng((seed, d))
    rotation = np.linalg.qr(rng.standard_normal((d, d)))[0]
    cost = FUNCTIONS[function]
    optimizer = STRATEGIES[strategy](rng.uniform(-1.0, 1.0, d), seed)
    evaluations, own = 0, 0.0
    while evaluations < most:
        samples, seconds = processor_time(optimizer.ask)
        own += seconds
        costs = cost(np.asarray(samples) @ rotation)
        evaluations += len(samples)
        if costs.min() < TARGET:
            return evaluations, 1e6 * own / evaluations
        own += processor_time(partial(optimizer.tell, costs))[1]
    return np.inf, 1e6 * own / evaluations


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: a table with one line for each function and dimension, then the requirements."""
    lines = [
        f"Evaluations until f < {result['target']:g}, start in [-1, 1], standard deviation {result['std']}, rotated,",
        f"medians of {result['runs']} runs; in brackets processor time of its own, us an evaluation:",
        f"  {'':<14}{'d':>3}{'NES':>18}{'CMA-ES':>18}{'ratio':>7}{'xNES':>8}",
    ]
    for row in result["rows"]:
        ours, theirs = (f"{row[key]:.0f} ({row[f'{key}_us']:.1f})" for key in ("nes", "cma"))
        published = f"{row['xnes']:>8.0f}" if "xnes" in row else ""
        lines.append(f"  {row['function']:<14}{row['dimensions']:>3}{ours:>18}{theirs:>18}{row['ratio']:>7.2f}{published}")
    return report_text(lines, result)
