"""How many evaluations evolution strategies need: ours beside CMA-ES on rotated functions, from the same starts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.bench.cma_peer import load_cma
from experiments.bench.nes_workload import FUNCTIONS, STD, TARGET, trial
from experiments.bench.verdicts import all_passed, judged
from experiments.bench.verdicts import lines as requirement_lines
from experiments.kit.command_line import Progress

REQUIRED, BOUND = "evaluations over CMA-ES's, median of the rows", 1.05
PUBLISHED = 10  # dimensions up to which the published form is run too


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
    required = [judged(REQUIRED, ratio, at_most=BOUND)]
    return {"target": TARGET, "std": STD, "runs": settings.runs, "rows": found, "requirements": required, "passed": all_passed(required)}


def _row(name: str, d: int, runs: int) -> dict[str, Any]:
    """Median evaluations of every strategy, infinite where it mostly fails, and the time of its own that one takes."""
    row: dict[str, Any] = {"function": name, "dimensions": d}
    for strategy in ("nes", "cma", "xnes") if d <= PUBLISHED else ("nes", "cma"):
        results = [trial(strategy, name, d, seed) for seed in range(runs)]
        row[strategy] = float(np.median([evaluations for evaluations, _ in results]))
        row[f"{strategy}_us"] = float(np.median([us for _, us in results]))
    row["ratio"] = row["nes"] / row["cma"]
    return row


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
    return "\n".join([*lines, *requirement_lines(result["requirements"])])
