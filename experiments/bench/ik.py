"""How often and how soon a pose is found for a palm among boxes: ours beside the thesis' rivals, on the same cost and targets."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import mobee
from experiments.bench.cma_peer import load_cma
from experiments.bench.ik_rivals import annealing, cma, particles
from experiments.bench.ik_workload import MOTORS, Target, scene, targets
from experiments.bench.rounds import one_core
from experiments.progress import Progress
from mobee.roadmap.problem import Problem
from mobee.robot.robot import Array

MOST = 20_000  # evaluations of a rival
NES, HYBRID, WHOLE = "NES", "least squares, then NES", "NES, all 41 motors"
CMA, CMA_BATCHED = "CMA-ES, pose by pose", "CMA-ES, a generation at once"
ANNEALING, PARTICLES = "simulated annealing", "particle filter"
RIVALS: dict[str, Callable[[Problem, int, int], Array | None]] = {
    CMA: lambda problem, seed, most: cma(problem, seed, most, batched=False),
    CMA_BATCHED: lambda problem, seed, most: cma(problem, seed, most, batched=True),
    ANNEALING: annealing,
    PARTICLES: particles,
}

# Name, row, key of the row, at least or at most, bound.
REQUIREMENTS = (
    ("NES, share reached", NES, "reached", "least", 0.99),
    ("NES, ms, median", NES, "ms", "most", 20.0),
    ("NES, ms, 95 %", NES, "ms_95", "most", 50.0),
    ("NES, times faster than CMA-ES pose by pose", NES, "times_cma", "least", 4.0),
    ("hybrid, share reached", HYBRID, "reached", "least", 1.0),
    ("hybrid, ms, median", HYBRID, "ms", "most", 0.5),
    ("hybrid, times faster than CMA-ES pose by pose", HYBRID, "times_cma", "least", 100.0),
    ("all 41 motors, share reached", WHOLE, "reached", "least", 0.97),
    ("all 41 motors, ms, median", WHOLE, "ms", "most", 100.0),
)


@dataclass(frozen=True, slots=True)
class Settings:
    """How many targets: for torso and arm, for all motors, and for the rivals."""

    targets: int = 300
    whole: int = 60
    rivals: int = 40


QUICK = Settings(targets=20, whole=5, rivals=5)


def measure(settings: Settings) -> dict[str, Any]:
    """All numbers, for people and scripts; raises CmaMissing."""
    load_cma()
    model = scene()
    aims = targets(model, max(settings.targets, settings.whole, settings.rivals))
    runs: list[tuple[str, int, Callable[[Target, int], tuple[bool, int]]]] = [
        (HYBRID, settings.targets, lambda aim, seed: _solved(model, aim, seed, MOTORS, "hybrid")),
        (NES, settings.targets, lambda aim, seed: _solved(model, aim, seed, MOTORS, "nes")),
        (WHOLE, settings.whole, lambda aim, seed: _solved(model, aim, seed, None, "nes")),
    ]
    runs += [(name, settings.rivals, _rival(model, name)) for name in RIVALS]
    rows: dict[str, dict[str, float]] = {}
    with one_core() as core, Progress() as progress:
        for number, (name, count, solve) in enumerate(runs):
            progress.show(number / len(runs), name)
            rows[name] = _row(solve, aims[:count])
    for row in rows.values():
        row["times_cma"] = rows[CMA]["ms"] / row["ms"]
    required = [_required(rows, *one) for one in REQUIREMENTS]
    return {"core": core, "rows": rows, "requirements": required, "passed": all(one["passed"] for one in required)}


def _solved(model: mobee.Model, aim: Target, seed: int, motors: Sequence[str] | None, method: Any) -> tuple[bool, int]:
    ik = mobee.solve_ik(model, aim.costs(), seed=seed, motors=motors, method=method)
    return ik.reached, ik.evaluations


def _rival(model: mobee.Model, name: str) -> Callable[[Target, int], tuple[bool, int]]:
    def solve(aim: Target, seed: int) -> tuple[bool, int]:
        problem = Problem(model, aim.costs(), None, MOTORS)
        return RIVALS[name](problem, seed, MOST) is not None, problem.evaluations

    return solve


def _row(solve: Callable[[Target, int], tuple[bool, int]], aims: Sequence[Target]) -> dict[str, float]:
    """The share of targets reached, and evaluations and processor time of a target, median and 95 %; failures count as they are."""
    solve(aims[0], 0)  # caches and lazy set-up
    reached, evaluations, ms = [], [], []
    for seed, aim in enumerate(aims):
        start = time.process_time()
        done, looked = solve(aim, seed)
        ms.append(1e3 * (time.process_time() - start))
        reached.append(done)
        evaluations.append(looked)
    row: dict[str, float] = {"targets": len(aims), "reached": float(np.mean(reached))}
    for key, values in (("evaluations", evaluations), ("ms", ms)):
        row |= {key: float(np.median(values)), f"{key}_95": float(np.quantile(values, 0.95))}
    return row


def _required(rows: dict[str, dict[str, float]], name: str, row: str, key: str, sense: str, bound: float) -> dict[str, Any]:
    found = rows[row][key]
    return {"name": name, "found": found, f"at_{sense}": bound, "passed": found <= bound if sense == "most" else found >= bound}


def report(result: dict[str, Any]) -> str:
    """The measurements as text."""
    lines = [
        "Right palm among 100 boxes: 5 mm, 5 degrees, no contact; torso and arm (10 motors).",
        "Median / 95 % of a target; processor time of one core:",
        f"  {'':<29}{'targets':>7}{'reached':>9}{'evaluations':>15}{'ms':>17}",
    ]
    for name, row in result["rows"].items():
        evaluations = f"{row['evaluations']:.0f} / {row['evaluations_95']:.0f}"
        ms = f"{row['ms']:.3g} / {row['ms_95']:.3g}"
        lines.append(f"  {name:<29}{row['targets']:>7}{100.0 * row['reached']:>7.1f} %{evaluations:>15}{ms:>17}")
    for one in result["requirements"]:
        bound = f">= {one['at_least']:g}" if "at_least" in one else f"<= {one['at_most']:g}"
        lines.append(f"  {one['name']:<53}{one['found']:9.3g} {bound:>8} {'pass' if one['passed'] else 'SHORT'}")
    return "\n".join(lines)
