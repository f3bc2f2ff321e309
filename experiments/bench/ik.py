"""How often and how soon a pose is found for a palm among boxes: ours beside mink and the thesis' rivals, on the same targets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from experiments.bench import calibration, ik_solvers
from experiments.bench import verdicts as requirement
from experiments.bench.calibration import Calibration
from experiments.bench.cma_peer import load_cma
from experiments.bench.ik_solvers import RIVALS, Entrant, Tries
from experiments.bench.ik_workload import MOTORS, scene, targets
from experiments.bench.mink_peer import load_mink
from experiments.bench.verdicts import judged, one_core
from experiments.kit.command_line import Progress

NES, HYBRID, WHOLE = "NES", "least squares, then NES", "NES, all 41 motors"
FINE_NES, FINE_HYBRID = "NES, 1 mm and 1 degree", "least squares first, 1 mm"
MINK = "mink, restarts"
FINE = {"metres": 0.001, "radians": float(np.deg2rad(1.0))}

# Name, row, key of the row, at least or at most, bound.
REQUIREMENTS = (
    ("NES, share reached", NES, "reached", "least", 0.99),
    ("NES, ms, median", NES, "standard_ms", "most", 25.0),
    ("NES, ms, 95 %", NES, "standard_ms_95", "most", 50.0),
    ("NES, times CMA-ES pose by pose", NES, "times_cma", "least", 4.0),
    ("hybrid, share reached", HYBRID, "reached", "least", 1.0),
    ("hybrid, ms, median", HYBRID, "standard_ms", "most", 1.0),
    ("hybrid, times CMA-ES pose by pose", HYBRID, "times_cma", "least", 100.0),
    ("all 41 motors, share reached", WHOLE, "reached", "least", 0.97),
    ("all 41 motors, ms, median", WHOLE, "standard_ms", "most", 100.0),
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
    entrants = {
        HYBRID: Entrant(hybrid, aims[: settings.targets]),
        NES: Entrant(nes, aims[: settings.targets]),
        WHOLE: Entrant(ik_solvers.library(model, "nes", None), aims[: settings.whole]),
        FINE_HYBRID: Entrant(hybrid, fine[: settings.targets]),
        FINE_NES: Entrant(nes, fine[: settings.targets]),
        MINK: Entrant(ik_solvers.mink(model), aims[: settings.targets]),
        **{name: Entrant(ik_solvers.rival(model, name, MOTORS), aims[: settings.rivals]) for name in RIVALS},
    }
    speeds = Calibration()
    with one_core() as core, Progress() as progress:
        found = ik_solvers.tried(entrants, speeds, lambda done, name: progress.show(done / len(aims), name))
    rows = {name: _row(tries) for name, tries in found.items()}
    for row in rows.values():
        row["times_cma"] = rows[ik_solvers.CMA]["standard_ms"] / row["standard_ms"]
    return {"core": core, "speed": speeds.median, "rows": rows} | verdict(rows)


def _row(tries: Tries) -> dict[str, float]:
    """The share of targets reached, and evaluations and processor time of a target, median and 95 %; failures count as they are."""
    row: dict[str, float] = {"targets": len(tries.reached), "reached": float(np.mean(tries.reached))}
    for key, values in (("evaluations", tries.evaluations), ("ms", tries.ms), ("standard_ms", tries.standard_ms)):
        row |= {key: float(np.median(values)), f"{key}_95": float(np.quantile(values, 0.95))}
    return row


def verdict(rows: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    """Whether poses are found as often and as soon as required."""
    required = [judged(name, rows[row][key], **{f"at_{sense}": bound}) for name, row, key, sense, bound in REQUIREMENTS]
    return {"requirements": required, "passed": requirement.all_passed(required)}


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
    return "\n".join([*lines, calibration.told(result["speed"]), *requirement.lines(result["requirements"])])


def _three(value: float) -> str:
    """Three digits that count, and no fewer than those before the point."""
    return f"{value:.0f}" if value >= 100.0 else f"{value:.3g}"
