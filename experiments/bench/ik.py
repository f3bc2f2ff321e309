"""How often and how soon a pose is found for a palm among boxes: ours beside mink and the thesis' rivals, on the same targets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from experiments.bench import ik_solvers
from experiments.bench.cma_peer import load_cma
from experiments.bench.ik_solvers import RIVALS, Solve
from experiments.bench.ik_workload import MOTORS, Target, scene, targets
from experiments.bench.mink_peer import load_mink
from experiments.bench.rounds import one_core
from experiments.progress import Progress

NES, HYBRID, WHOLE = "NES", "least squares, then NES", "NES, all 41 motors"
FINE_NES, FINE_HYBRID = "NES, 1 mm and 1 degree", "least squares first, 1 mm"
MINK = "mink, restarts"
FINE = {"metres": 0.001, "radians": float(np.deg2rad(1.0))}

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
    """All numbers, for people and scripts; raises CmaMissing, MinkMissing and MujocoMissing."""
    load_cma()
    load_mink()
    model = scene()
    aims = targets(model, max(settings.targets, settings.whole, settings.rivals))
    fine = [replace(aim, **FINE) for aim in aims]
    hybrid, nes = (ik_solvers.library(model, method, MOTORS) for method in ("hybrid", "nes"))
    runs: list[tuple[str, Solve, list[Target]]] = [
        (HYBRID, hybrid, aims[: settings.targets]),
        (NES, nes, aims[: settings.targets]),
        (WHOLE, ik_solvers.library(model, "nes", None), aims[: settings.whole]),
        (FINE_HYBRID, hybrid, fine[: settings.targets]),
        (FINE_NES, nes, fine[: settings.targets]),
        (MINK, ik_solvers.mink(model), aims[: settings.targets]),
        *((name, ik_solvers.rival(model, name, MOTORS), aims[: settings.rivals]) for name in RIVALS),
    ]
    rows: dict[str, dict[str, float]] = {}
    with one_core() as core, Progress() as progress:
        for number, (name, solve, wanted) in enumerate(runs):
            progress.show(number / len(runs), name)
            rows[name] = _row(solve, wanted)
    for row in rows.values():
        row["times_cma"] = rows[ik_solvers.CMA]["ms"] / row["ms"]
    required = [_required(rows, *one) for one in REQUIREMENTS]
    return {"core": core, "rows": rows, "requirements": required, "passed": all(one["passed"] for one in required)}


def _row(solve: Solve, aims: Sequence[Target]) -> dict[str, float]:
    """The share of targets reached, and evaluations and processor time of a target, median and 95 %; failures count as they are."""
    tries = ik_solvers.tried(solve, aims)
    row: dict[str, float] = {"targets": len(aims), "reached": float(tries.reached.mean())}
    for key, values in (("evaluations", tries.evaluations), ("ms", tries.ms)):
        row |= {key: float(np.median(values)), f"{key}_95": float(np.quantile(values, 0.95))}
    return row


def _required(rows: dict[str, dict[str, float]], name: str, row: str, key: str, sense: str, bound: float) -> dict[str, Any]:
    found = rows[row][key]
    return {"name": name, "found": found, f"at_{sense}": bound, "passed": found <= bound if sense == "most" else found >= bound}


def report(result: dict[str, Any]) -> str:
    """The measurements as text."""
    lines = [
        "Right palm among 100 boxes: 5 mm, 5 degrees, no contact; torso and arm (10 motors).",
        "Median / 95 % of a target; processor time of one core; times faster than CMA-ES:",
        f"  {'':<29}{'targets':>7}{'reached':>9}{'evaluations':>14}{'ms':>14}{'times':>7}",
    ]
    for name, row in result["rows"].items():
        evaluations = f"{row['evaluations']:.0f} / {row['evaluations_95']:.0f}"
        ms = f"{_three(row['ms'])} / {_three(row['ms_95'])}"
        lines.append(
            f"  {name:<29}{row['targets']:>7}{100.0 * row['reached']:>7.1f} %{evaluations:>14}{ms:>14}{_three(row['times_cma']):>7}"
        )
    for one in result["requirements"]:
        bound = f">= {one['at_least']:g}" if "at_least" in one else f"<= {one['at_most']:g}"
        lines.append(f"  {one['name']:<53}{one['found']:9.3g} {bound:>8} {'pass' if one['passed'] else 'SHORT'}")
    return "\n".join(lines)


def _three(value: float) -> str:
    """Three digits that count, and no fewer than those before the point."""
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"
