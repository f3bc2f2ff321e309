# SPDX-License-Identifier: Apache-2.0
"""Builds the pre-grasp roadmap of thesis figure 4.8 by least squares and by an evolution strategy, and measures both.

The measures are the time, the coverage of the reachable points, and the share of valid vertices.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import mobee
from experiments.bench.timing import Calibration, Crew, some_cores
from experiments.bench.verdicts import Requirement, report_text, verdict
from experiments.claims.ch3_roadmaps.trm import coverage, reachable, valid
from experiments.claims.ch3_roadmaps.trm_tasks import PREGRASP_SPACING, pregrasp
from experiments.kit.command_line import Progress
from experiments.kit.roadmap_task import Example
from mobee.arrays import Array
from mobee.roadmap.building.build import MAX_TURN
from mobee.roadmap.graph import nearest, short
from mobee.roadmap.roadmap import Roadmap

LEAST_SQUARES, NES, HYBRID = "least_squares", "nes", "hybrid"
CORES = 2
NEIGHBOURS = 8  # thesis 4.3.3
WARM_UP_SPACING = 0.1  # m, of a map that is not timed
MIN_VERTICES = 4000
LARGER_IS_WORSE = ("wall_s", "processor_s", "standard_wall_s", "evaluations", "largest_hole")

REQUIREMENTS = tuple(
    Requirement(f"{method}, {name}", ("rows", method, key), at_least, at_most)
    for method, seconds in ((LEAST_SQUARES, 2.0), (NES, 25.0))
    for name, key, at_least, at_most in (
        ("s on 2 cores", "standard_wall_s", None, seconds),
        ("coverage", "coverage", 0.99, None),
        ("largest hole, spacings", "largest_hole", None, 1.5),
        ("valid by python-fcl", "valid", 1.0, None),
    )
)


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.

    `spacing`: distance between vertices of the roadmap [m].  `seeds`: number of roadmaps that each method builds.  `vertices`: required
    number of vertices.  `methods`: names of the methods ("least_squares", "nes", "hybrid").
    """

    spacing: float = PREGRASP_SPACING
    seeds: int = 1
    vertices: int = MIN_VERTICES
    methods: Sequence[str] = (LEAST_SQUARES, NES, HYBRID)


QUICK = Settings(spacing=0.03, vertices=300)


def measure(settings: Settings) -> dict[str, Any]:
    """Run this benchmark and return its result.

    Main keys: "rows", a dict from a method to a dict of measures, each the worst one of all seeds; "reachable", number of reachable points
    with which coverage is computed; "requirements", a list with the dict that `Requirement.judge` returns for each requirement; "passed",
    whether all are met.  The measures are: times [s], "wall_s", "processor_s" and "standard_wall_s" (the wall time converted to the
    standard machine of timing.py); number of "vertices"; "evaluations" per vertex; "coverage" (share of the reachable points that are
    covered); "largest_hole" (in units of the spacing); share of "valid" vertices; and share of "short_edges" (along which no motor turns
    too far).
    """
    example = replace(pregrasp(), margin=0.0)  # all that can be reached
    spacing = np.full(len(example.task.names), settings.spacing)
    rows: dict[str, dict[str, float]] = {}
    with Progress() as progress:
        with some_cores(CORES) as cores, Crew(CORES) as crew:
            speeds = Calibration(crew.loops)
            _build(example, WARM_UP_SPACING, LEAST_SQUARES, 0)
            maps: dict[str, list[tuple[Roadmap, dict[str, float]]]] = {}
            for number, method in enumerate(settings.methods):
                progress.show(number / (len(settings.methods) + 1), method)
                maps[method] = [_timed(example, settings.spacing, method, seed, speeds) for seed in range(settings.seeds)]
        progress.show(len(maps) / (len(maps) + 1), "reachable places")
        points = reachable(example.model, example.costs, example.task, spacing, example.motors, example.start, example.margin)
        points = np.concatenate([points, *(trm.y for runs in maps.values() for trm, _ in runs)])
        for method, runs in maps.items():
            each = [figures | _quality(example, trm, points, spacing) for trm, figures in runs]
            rows[method] = {key: (max if key in LARGER_IS_WORSE else min)(one[key] for one in each) for key in each[0]}
    about = {"cores": cores, "speed": speeds.median, "spacing": settings.spacing, "reachable": len(points), "rows": rows}
    required = [one for one in REQUIREMENTS if one.is_measured(about)]
    required += [Requirement(f"{method}, vertices", ("rows", method, "vertices"), at_least=settings.vertices) for method in rows]
    return about | verdict(about, required)


def _build(example: Example, spacing: float, method: Any, seed: int) -> Roadmap:
    return mobee.build_roadmap(
        example.model,
        example.costs,
        example.task,
        spacing,
        example.start,
        example.motors,
        seed,
        mobee.RoadmapSettings(method, NEIGHBOURS, margin=example.margin),
    )


def _timed(example: Example, spacing: float, method: str, seed: int, speeds: Calibration) -> tuple[Roadmap, dict[str, float]]:
    def run() -> tuple[Roadmap, float, float]:
        wall, processor = time.perf_counter(), time.process_time()
        trm = _build(example, spacing, method, seed)
        return trm, time.perf_counter() - wall, time.process_time() - processor

    (trm, wall, processor), speed = speeds.around(run)
    figures = {"wall_s": wall, "processor_s": processor, "standard_wall_s": wall * speed}
    return trm, figures | {"vertices": len(trm.q), "evaluations": trm.settings["evaluations"] / len(trm.q)}


def _quality(example: Example, trm: Roadmap, points: Array, spacing: Array) -> dict[str, float]:
    found = coverage(points, trm.y, spacing)
    joined = nearest(trm.y, spacing, NEIGHBOURS)
    good = valid(example.model, example.costs, example.task, trm.q, trm.y, example.motors, example.start)
    return {
        "coverage": found.share,
        "largest_hole": found.largest_hole,
        "valid": float(good.mean()),
        "short_edges": len(short(trm.q, joined, MAX_TURN)) / len(joined),
    }


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: a table with one line for each method, then the requirements."""
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
    lines.append(f"  hole: in spacings; edges: share no longer than {MAX_TURN:g} rad, {NEIGHBOURS} neighbours")
    return report_text(lines, result)
