"""The pre-grasp map of thesis figure 4.8 by least squares and by the evolution strategy: how soon, how complete, how valid."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import mobee
from experiments.bench.rounds import some_cores
from experiments.progress import Progress
from experiments.trm import pregrasp
from experiments.trm.coverage import coverage, reachable, valid
from experiments.trm.example import Example
from mobee.roadmap.building.build import LONGEST
from mobee.roadmap.neighbours import nearest, short
from mobee.roadmap.roadmap import Roadmap
from mobee.robot.robot import Array

LEAST_SQUARES, NES, HYBRID = "least_squares", "nes", "hybrid"
CORES = 2
NEIGHBOURS = 8  # thesis 4.3.3
WARM = 0.1  # m, spacing of a map that nobody times

# Name, method, key, at least or at most, bound.
REQUIREMENTS = tuple(
    (f"{method}, {name}", method, key, sense, bound)
    for method, seconds in ((LEAST_SQUARES, 3.0), (NES, 40.0))
    for name, key, sense, bound in (
        ("wall s on 2 cores", "wall_s", "most", seconds),
        ("coverage", "coverage", "least", 0.99),
        ("largest hole, spacings", "largest_hole", "most", 1.5),
        ("share of poses valid by python-fcl", "valid", "least", 1.0),
    )
)
VERTICES = 4000


@dataclass(frozen=True, slots=True)
class Settings:
    """The spacing [m], the seeds of each method, how many vertices there must be, and the methods."""

    spacing: float = pregrasp.SPACING
    seeds: int = 1
    vertices: int = VERTICES
    methods: Sequence[str] = (LEAST_SQUARES, NES, HYBRID)


QUICK = Settings(spacing=0.03, vertices=300)


def measure(settings: Settings) -> dict[str, Any]:
    """All numbers, for people and scripts; of several seeds the worst."""
    example = replace(pregrasp.example(), margin=0.0)  # all that can be reached
    spacing = np.full(len(example.task.names), settings.spacing)
    rows: dict[str, dict[str, float]] = {}
    with Progress() as progress:
        with some_cores(CORES) as cores:
            _built(example, WARM, LEAST_SQUARES, 0)
            maps: dict[str, list[tuple[Roadmap, dict[str, float]]]] = {}
            for number, method in enumerate(settings.methods):
                progress.show(number / (len(settings.methods) + 1), method)
                maps[method] = [_timed(example, settings.spacing, method, seed) for seed in range(settings.seeds)]
        progress.show(len(maps) / (len(maps) + 1), "what can be reached")
        points = reachable(example.model, example.costs, example.task, spacing, example.motors, example.start, example.margin)
        points = np.concatenate([points, *(trm.y for runs in maps.values() for trm, _ in runs)])
        for method, runs in maps.items():
            each = [figures | _judged(example, trm, points, spacing) for trm, figures in runs]
            rows[method] = {key: _worst(key, [one[key] for one in each]) for key in each[0]}
    required = [_required(rows, *one) for one in REQUIREMENTS if one[1] in rows]
    required += [_required(rows, f"{method}, vertices", method, "vertices", "least", settings.vertices) for method in rows]
    return {
        "cores": cores,
        "spacing": settings.spacing,
        "reachable": len(points),
        "rows": rows,
        "requirements": required,
        "passed": all(one["passed"] for one in required),
    }


def _built(example: Example, spacing: float, method: Any, seed: int) -> Roadmap:
    return mobee.build_roadmap(
        example.model,
        example.costs,
        example.task,
        spacing,
        example.start,
        example.motors,
        method,
        seed,
        neighbours=NEIGHBOURS,
        margin=example.margin,
    )


def _timed(example: Example, spacing: float, method: str, seed: int) -> tuple[Roadmap, dict[str, float]]:
    wall, processor = time.perf_counter(), time.process_time()
    trm = _built(example, spacing, method, seed)
    figures = {"wall_s": time.perf_counter() - wall, "processor_s": time.process_time() - processor}
    return trm, figures | {"vertices": len(trm.q), "evaluations": trm.settings["evaluations"] / len(trm.q)}


def _judged(example: Example, trm: Roadmap, points: Array, spacing: Array) -> dict[str, float]:
    found = coverage(points, trm.y, spacing)
    joined = nearest(trm.y, spacing, NEIGHBOURS)
    good = valid(example.model, example.costs, example.task, trm.q, trm.y, example.motors, example.start)
    return {
        "coverage": found.share,
        "largest_hole": found.largest_hole,
        "valid": float(good.mean()),
        "short_edges": len(short(trm.q, joined, LONGEST)) / len(joined),
    }


def _worst(key: str, values: Sequence[float]) -> float:
    return max(values) if key in ("wall_s", "processor_s", "evaluations", "largest_hole") else min(values)


def _required(rows: dict[str, dict[str, float]], name: str, row: str, key: str, sense: str, bound: float) -> dict[str, Any]:
    found = rows[row][key]
    return {"name": name, "found": found, f"at_{sense}": bound, "passed": bool(found <= bound if sense == "most" else found >= bound)}


def report(result: dict[str, Any]) -> str:
    """The measurements as text."""
    lines = [
        f"Right palm down over the table (thesis figure 4.8), {1e3 * result['spacing']:g} mm apart,",
        f"on {len(result['cores']) or 'all'} cores; {result['reachable']} reachable places to compare with:",
        f"  {'':<13}{'vertices':>9}{'poses each':>11}{'wall s':>8}{'cpu s':>7}{'covered':>9}{'hole':>6}{'valid':>8}{'edges':>7}",
    ]
    for name, row in result["rows"].items():
        valid_share, edges = 100.0 * row["valid"], 100.0 * row["short_edges"]
        counts = f"{row['vertices']:>9.0f}{row['evaluations']:>11.0f}{row['wall_s']:>8.1f}{row['processor_s']:>7.1f}"
        shares = f"{100.0 * row['coverage']:>7.2f} %{row['largest_hole']:>6.2f}{valid_share:>6.1f} %{edges:>5.1f} %"
        lines.append(f"  {name:<13}{counts}{shares}")
    lines.append(f"  hole: in spacings; edges: share of no more than {LONGEST:g} rad, {NEIGHBOURS} neighbours")
    for one in result["requirements"]:
        bound = f">= {one['at_least']:g}" if "at_least" in one else f"<= {one['at_most']:g}"
        lines.append(f"  {one['name']:<50}{one['found']:9.4g} {bound:>8} {'pass' if one['passed'] else 'SHORT'}")
    return "\n".join(lines)
