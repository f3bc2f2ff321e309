"""What the runs say: evaluations over those of CMA-ES, task by task."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.bench.nes_workload import FUNCTIONS, STRATEGIES
from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import decides, interval, ratio, ratio_interval, told
from mobee.robot.robot import Array

DIMENSIONS = (10, 20, 41)
FEWER, COMPARABLE, REQUIRED = 0.95, 1.5, 1.05  # evaluations over those of CMA-ES
NAMES = {"nes": "the library's default", "cma": "CMA-ES", "xnes": "xNES as published", "snes": "SNES as published"}

_THESIS = "thesis 3.1"
BETTER = {
    name: Claim(_THESIS, f"NES outperforms CMA on some tasks: {NAMES[name]}", "no number, some tasks") for name in ("xnes", "snes", "nes")
}
AS_GOOD = {
    name: Claim(_THESIS, f"NES is in many ways comparable to CMA (at most {COMPARABLE} x the evaluations): {NAMES[name]}", "no number")
    for name in ("xnes", "snes", "nes")
}
AIM = Claim(
    "aim of this reproduction", "the default NES needs at most 1.05 x CMA-ES's evaluations, median of the tasks", f"at most {REQUIRED}"
)
CLAIMS = (*BETTER.values(), *AS_GOOD.values(), AIM)

Task = tuple[str, int]  # function and dimensions


def evaluations(found: Mapping[str, CellResult]) -> dict[tuple[str, Task], Array]:
    """Of every strategy and task, (seeds,), in the order of the seeds."""
    runs: dict[tuple[str, Task], list[float]] = {}
    for result in sorted(found.values(), key=lambda result: result.cell.seed):
        settings = result.cell.settings
        task = settings["function"], settings["dimensions"]
        runs.setdefault((settings["strategy"], task), []).append(float(result.values["evaluations"]))
    return {key: np.array(values) for key, values in runs.items()}


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a task, and the claims."""
    runs = evaluations(found)
    return {
        "evaluations": {
            f"{function}, {d}": {NAMES[s]: told(runs[s, (function, d)], 0) for s in STRATEGIES if (s, (function, d)) in runs}
            for function, d in tasks(runs)
        },
        "found": {NAMES[name]: _share(found, name) for name in STRATEGIES},
        "claims": [claim.record() for claim in judged(runs)],
    }


def tasks(runs: Mapping[tuple[str, Task], Array]) -> list[Task]:
    """The tasks of which there are runs, in the order of the functions."""
    return [(function, d) for function in FUNCTIONS for d in DIMENSIONS if any(task == (function, d) for _, task in runs)]


def judged(runs: Mapping[tuple[str, Task], Array]) -> list[Claim]:
    """The claims with our numbers; open unless every strategy has run on every task with as many seeds."""
    everything = [(name, (function, d)) for name in STRATEGIES for function in FUNCTIONS for d in DIMENSIONS]
    if any(key not in runs for key in everything) or len({len(runs[key]) for key in everything}) > 1:
        return list(CLAIMS)
    medians = {name: _medians(runs, name) for name in BETTER}
    told_medians = {name: f"{told(values)} x CMA-ES's evaluations, median of the tasks" for name, values in medians.items()}
    return [
        *(_better(runs, name, claim) for name, claim in BETTER.items()),
        *(c.measured(told_medians[name], decides(interval(medians[name]), most=COMPARABLE)) for name, c in AS_GOOD.items()),
        AIM.measured(told_medians["nes"], decides(interval(medians["nes"]), most=REQUIRED)),
    ]


def _medians(runs: Mapping[tuple[str, Task], Array], name: str) -> Array:
    """Evaluations over those of CMA-ES from the same start, median of the tasks, (seeds,)."""
    ratios = [runs[name, task] / runs["cma", task] for task in tasks(runs)]
    medians: Array = np.median(ratios, axis=0)
    return medians


def _better(runs: Mapping[tuple[str, Task], Array], name: str, claim: Claim) -> Claim:
    """It holds if one task's interval lies below the bound, and does not if all lie above it."""
    pairs = {task: (runs[name, task], runs["cma", task]) for task in tasks(runs)}
    spans = {task: ratio_interval(*pair) for task, pair in pairs.items()}
    fewer = [task for task, span in spans.items() if span[1] <= FEWER]
    best = min(pairs, key=lambda task: ratio(*pairs[task]))
    low, high = spans[best]
    text = (
        f"fewer than {FEWER} x CMA-ES's evaluations on {len(fewer)} of {len(pairs)} tasks; at best"
        f" {ratio(*pairs[best]):.2f} x [{low:.2f}, {high:.2f}] ({best[0]}, {best[1]} dimensions)"
    )
    return claim.measured(text, True if fewer else False if all(span[0] > FEWER for span in spans.values()) else None)


def _share(found: Mapping[str, CellResult], strategy: str) -> str:
    """How many of its runs came to the target."""
    mine = [result.values["found"] for result in found.values() if result.cell.settings["strategy"] == strategy]
    return f"{sum(mine)} of {len(mine)}"
