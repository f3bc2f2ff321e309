# SPDX-License-Identifier: Apache-2.0
"""NES: number of evaluations that natural evolution strategies need, compared with CMA-ES.

Claim: NES is in many ways comparable to CMA, and outperforms CMA on some tasks.  Source: thesis 3.1.  Published: no numbers here.  Run
time: 3 minutes on 2 cores.

A task is a function (sphere, ellipsoid and cigar of condition 1e6, Rosenbrock) of 10, 20 or 41 dimensions, rotated; each run has its own
rotation and its own start in [-1, 1], the same for all strategies; the initial standard deviation is 0.5.  The evaluations until f < 1e-8
are counted; a run that does not reach this counts as 400 000.  Strategies: xNES and SNES as published (Glasmachers 2010, Schaul 2011), the
library's default (xNES with CMA-ES's path, weights and rates), and CMA-ES by its author, all with their default populations.  "Outperforms
on some tasks": fewer evaluations on at least one of the twelve tasks.  Each of these comparisons uses a confidence interval with a twelfth
of the error rate (Bonferroni).  "Comparable": the number of evaluations, divided by that of CMA-ES, is at most 1.5 (median of the tasks).
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from experiments.bench.nes import FUNCTIONS, MAX_EVALUATIONS, STRATEGIES, search
from experiments.bench.peers import load_cma
from experiments.kit.experiment import OUR_AIM, Claim, Envelope, Experiment, Measured, judged
from experiments.kit.plots import draw_curve, finish, new_figure, ticks_at
from experiments.kit.rules import within
from experiments.kit.statistics import estimate, level_of_each, ratio, ratio_estimate, ratio_interval
from experiments.kit.sweep import Cells, Condition, Sweep, runs_by
from mobee.arrays import Array

DIMENSIONS = (10, 20, 41)
QUICK_MAX_EVALUATIONS = 20_000  # evaluations
COSTS = {"nes": 1.0, "cma": 6.0, "xnes": 4.0, "snes": 8.0}  # beside each other
COMPARABLE, REQUIRED = 1.5, 1.05  # evaluations over those of CMA-ES
NAMES = {"nes": "the library's default", "cma": "CMA-ES", "xnes": "xNES as published", "snes": "SNES as published"}

Task = tuple[str, int]  # function and dimensions
Runs = Mapping[tuple[str, Task], Array]  # evaluations (seeds,) of every strategy and task


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the conditions of the sweep: every strategy on every task.  With --quick: 10 dimensions and at most 20 000 evaluations."""
    dimensions, most = (DIMENSIONS[:1], QUICK_MAX_EVALUATIONS) if arguments.quick else (DIMENSIONS, MAX_EVALUATIONS)
    return [
        Condition(
            f"{strategy}-{function.replace(' ', '-')}-{d}",
            {"strategy": strategy, "function": function, "dimensions": d, "most": most},
            COSTS[strategy] * d,
        )
        for d in dimensions
        for function in FUNCTIONS
        for strategy in STRATEGIES
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Search for the minimum of a test function with one strategy, and return how many evaluations it needed.

    `settings`: name of the strategy and of the function, number of dimensions, and the limit "most" of evaluations.  `seed`: of the random
    numbers.  Keys of the result: "evaluations", the number needed, at most "most"; "found", whether the minimum was found; "us", processor
    time of the strategy per evaluation, without the time of the function [us].
    """
    most = settings["most"]
    evaluations, us = search(settings["strategy"], settings["function"], settings["dimensions"], seed, most)
    return {"evaluations": min(evaluations, most), "found": evaluations <= most, "us": us}


def evaluations(found: Cells) -> Runs:
    """Return a dict from (strategy, task) to the numbers of evaluations that the searches needed, (seeds,), sorted by seed.

    A task is a pair: the name of a function, and the number of dimensions.
    """
    by_condition = runs_by(found, lambda result: float(result.values["evaluations"]), "strategy", "function", "dimensions")
    return {(key[0], (key[1], key[2])): np.array(values) for key, values in by_condition.items()}


def are_complete(runs: Runs) -> bool:
    """Whether every strategy has run on every task, all with equally many seeds."""
    everything = list(product(STRATEGIES, product(FUNCTIONS, DIMENSIONS)))
    return all(key in runs for key in everything) and len({len(runs[key]) for key in everything}) == 1


def findings(found: Cells) -> dict[str, Any]:
    """Return the results of the sweep.

    Keys: "evaluations", a dict from "function, dimensions" to a dict from the strategy to the evaluations, as text; "found", a dict from
    the strategy to the number of successful runs, as text; "claims", a list with the judged claims, as dicts (`Claim.record`).
    """
    runs = evaluations(found)
    return {
        "evaluations": {
            f"{task[0]}, {task[1]}": {NAMES[name]: estimate(runs[name, task], 0) for name in STRATEGIES if (name, task) in runs}
            for task in tasks(runs)
        },
        "found": {NAMES[name]: _share(found, name) for name in STRATEGIES},
        "claims": judged(CLAIMS, runs, are_complete(runs)),
    }


def tasks(runs: Runs) -> list[Task]:
    """Return the tasks (function, dimensions) that have runs, in the order of FUNCTIONS and DIMENSIONS."""
    return [(function, d) for function in FUNCTIONS for d in DIMENSIONS if any(task == (function, d) for _, task in runs)]


def _fewer(name: str, runs: Runs) -> tuple[str, bool | None]:
    """Judge whether the strategy `name` needs fewer evaluations than CMA-ES on at least one task.

    Returns a text, and the verdict: True if it needs significantly fewer on a task, False if significantly more on every task, else None.
    The confidence intervals are widened for the number of tasks (Bonferroni).
    """
    pairs = {task: (runs[name, task], runs["cma", task]) for task in tasks(runs)}
    spans = {task: ratio_interval(*pair, level_of_each(len(pairs))) for task, pair in pairs.items()}
    found = [task for task, span in spans.items() if span[1] < 1.0]
    best = min(pairs, key=lambda task: ratio(*pairs[task]))
    text = (
        f"{NAMES[name]}: fewer evaluations on {len(found)} of {len(pairs)} tasks, at best"
        f" {ratio_estimate(*pairs[best]).replace(' ', ' x ', 1)} ({best[0]}, {best[1]} dimensions)"
    )
    return text, True if found else False if all(span[0] > 1.0 for span in spans.values()) else None


def _medians(name: str, runs: Runs) -> Array:
    """Return, for each seed, the median over the tasks of a strategy's evaluations divided by those of CMA-ES, (seeds,).

    Both searches of a ratio have the same seed and thus the same start point.
    """
    medians: Array = np.median([runs[name, task] / runs["cma", task] for task in tasks(runs)], axis=0)
    return medians


def _with_each(rule: Callable[[str, Runs], Measured], runs: Runs) -> Measured:
    each = {NAMES[name]: rule(name, runs) for name in OURS}
    found = {name: holds for name, (_, holds) in each.items() if not isinstance(holds, Envelope)}
    return "; ".join(text for text, _ in each.values()), Envelope("strategy", found)


def _comparable(name: str, runs: Runs) -> Measured:
    return within(_medians(name, runs), most=COMPARABLE, text=f"{NAMES[name]} {{}} x CMA-ES's evaluations, median of the tasks")


OURS = ("xnes", "snes", "nes")
CLAIMS = (
    Claim(
        "thesis 3.1",
        "NES outperforms CMA on some tasks: fewer evaluations on one of the twelve or more",
        "no number, some tasks",
        rule=partial(_with_each, _fewer),
    ),
    Claim(
        "thesis 3.1",
        f"NES is in many ways comparable to CMA: at most {COMPARABLE} x the evaluations",
        "no number",
        rule=partial(_with_each, _comparable),
    ),
    Claim(
        OUR_AIM,
        f"the default NES needs at most {REQUIRED} x CMA-ES's evaluations, median of the tasks",
        f"at most {REQUIRED}",
        rule=lambda runs: within(_medians("nes", runs), most=REQUIRED, text="{} x CMA-ES's evaluations, median of the tasks"),
    ),
)


def _share(found: Cells, strategy: str) -> str:
    """Return the number of runs of a strategy that found the minimum, as text."""
    mine = [result.values["found"] for result in found.values() if result.cell.settings["strategy"] == strategy]
    return f"{sum(mine)} of {len(mine)}"


def plot(found: Cells) -> Any:
    """Return a figure of evaluations over dimensions, a panel for each function: interquartile means and 95 % intervals."""
    runs = evaluations(found)
    drawing = new_figure(12.0, 3.4)
    for axes, function in zip(drawing.subplots(1, len(FUNCTIONS), sharey=True), FUNCTIONS, strict=True):
        for number, name in enumerate(STRATEGIES):
            at = [d for other, d in tasks(runs) if other == function and (name, (function, d)) in runs]
            if at:
                seeds = min(len(runs[name, (function, d)]) for d in at)
                values = np.array([runs[name, (function, d)][:seeds] for d in at]).T
                draw_curve(axes, at, values, f"C{number}", NAMES[name])
        finish(axes, title=function, xlabel="dimensions", xscale="log", yscale="log")
        ticks_at(axes, DIMENSIONS)
    drawing.axes[0].set_ylabel("evaluations until f < 1e-8")
    drawing.axes[0].legend(fontsize=7)
    return drawing


EXPERIMENT = Experiment(
    claim="natural evolution strategies are comparable to CMA-ES, and outperform it on some tasks",
    source="thesis 3.1",
    method=Sweep(conditions, trial, findings, plot, require=load_cma),
    claims=CLAIMS,
)
