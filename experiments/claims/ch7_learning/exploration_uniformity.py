"""Uniformity: how evenly do three explorers visit states and try actions, and do failing actions stand out?

Claim: after 4000 transitions the curious agent's visits over states and tries over state-actions are more uniform than those of
random and least-tried exploration, but for spikes at the actions that run into constraints.
Source: paper 3.1, fig. 5 (one run of the real robot an explorer).  No numbers are published.  Run time: 2 minutes on 2 cores.

The left arm with its cable constraints and self-contacts; 81 states with actions to their 16 nearest neighbours (ties drawn once, with
one seed: all runs share that graph, and the numbers may be its own), and for comparison to their equidistant ones.  Actions at
constraints are those that fail in more than half of all explorers' tries together, those of the run that is judged left out.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from experiments.kit.experiment import Claim, Experiment
from experiments.kit.learning.arm import ARM_NEIGHBOURS, arm_plant, arm_space
from experiments.kit.learning.exploration import begin_anywhere, explore
from experiments.kit.learning.outcomes import Explored, Groups, constraint_actions, explored, relative_tries_of
from experiments.kit.plots import new_figure
from experiments.kit.statistics import (
    decides,
    estimate,
    gini,
    interquartile_mean,
    interval,
    mean_over,
    ratio,
    ratio_interval,
    relative_spread,
)
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import CuriousAgent, Lattice

EXPLORERS = ("curious", "least_tried", "random")
GRAPHS = ("nearest", "equidistant")
TRANSITIONS, FEW = 4000, 1500
SPIKE = 1.5  # times the tries of the others
AS_EVEN = 1.1  # times the Gini coefficient: no less even

VISITS = Claim(
    "paper 3.1, fig. 5", "visits over states are more uniform than with least-tried and random exploration (one graph)", "qualitative"
)
TRIES = Claim(
    "paper 3.1, fig. 5", "tries over state-actions are more uniform than with least-tried and random exploration (one graph)", "qualitative"
)
SPIKES = Claim(
    "paper 3.1, fig. 5",
    "the curious agent tries actions at constraints more often than the others: ratio of mean tries (one graph)",
    "spikes",
)
NONE = Claim("paper 3.1, fig. 5", "least-tried and random exploration have no such spikes", "none visible")
SAME = Claim(
    "aim of this reproduction", "with equidistant neighbours least-tried tries as evenly as curiosity: fig. 5 depends on its graph", "-"
)
CLAIMS = (VISITS, TRIES, SPIKES, NONE, SAME)


@cache
def space_of(graph: str) -> Lattice:
    """The lattice of a graph."""
    return arm_space(neighbours=ARM_NEIGHBOURS if graph == "nearest" else "equidistant")


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Every explorer on every graph; the short version makes fewer transitions."""
    count = FEW if arguments.quick else TRANSITIONS
    return [
        Condition(f"{graph}-{explorer}-n{count}", {"graph": graph, "explorer": explorer, "transitions": count})
        for graph, explorer in product(GRAPHS, EXPLORERS)
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore; the transitions (T, 3)."""
    space, plant = space_of(settings["graph"]), arm_plant(seed)
    begin_anywhere(space, plant, seed)
    agent = CuriousAgent(space, plant, settings["explorer"], seed)
    return {"seen": explore(agent, settings["transitions"]).astype(np.uint16)}


def groups(found: Cells) -> Groups:
    """The runs of each graph and explorer, by seed."""
    return explored(found, space_of, "graph", "explorer")


def findings(found: Cells) -> dict[str, Any]:
    """A row for each graph and explorer, and the claims."""
    grouped = groups(found)
    rows = {f"{graph}, {explorer}": _row(grouped, graph, explorer) for graph, explorer in grouped}
    complete = all((graph, explorer) in grouped for graph in GRAPHS for explorer in EXPLORERS)
    return {"runs": rows, "claims": [claim.record() for claim in (measured(grouped) if complete else CLAIMS)]}


def _row(grouped: Groups, graph: str, explorer: str) -> dict[str, Any]:
    runs, spikes = grouped[graph, explorer], _spikes(grouped, graph, explorer)
    return {
        "seeds": len(runs),
        "tries_spread": mean_over(runs, lambda run: relative_spread(run.tries)),
        "tries_gini": mean_over(runs, lambda run: gini(run.tries)),
        "fewest": min(int(run.tries.min()) for run in runs),
        "most": max(int(run.tries.max()) for run in runs),
        "visits_spread": mean_over(runs, lambda run: relative_spread(run.visits)),
        "at_constraints": interquartile_mean(spikes) if spikes else None,
        "constraint_actions": int(constraint_actions(_all_runs(grouped, graph)).sum()),
    }


def _all_runs(grouped: Groups, graph: str) -> list[Explored]:
    return [run for explorer in EXPLORERS for run in grouped.get((graph, explorer), [])]


def _spikes(grouped: Groups, graph: str, explorer: str) -> list[float]:
    """Mean tries of actions at constraints over those of the others, of each run: those that fail in all the other runs' tries."""
    return relative_tries_of(grouped[graph, explorer], _all_runs(grouped, graph))


def measured(grouped: Groups) -> list[Claim]:
    """The claims with our numbers, of the runs of all explorers on both graphs."""
    visits = {e: [relative_spread(run.visits) for run in grouped["nearest", e]] for e in EXPLORERS}
    tries = {e: [gini(run.tries) for run in grouped["nearest", e]] for e in EXPLORERS}
    even = {e: [gini(run.tries) for run in grouped["equidistant", e]] for e in EXPLORERS}
    return [
        VISITS.measured(f"standard deviation over mean: {_each(visits)}", _is_least(visits)),
        TRIES.measured(f"Gini coefficient: {_each(tries)}", _is_least(tries)),
        *_spike_claims({e: _spikes(grouped, "nearest", e) for e in EXPLORERS}),
        SAME.measured(f"Gini coefficient: {_each(even)}", decides(ratio_interval(even["least_tried"], even["curious"]), most=AS_EVEN)),
    ]


def _spike_claims(spikes: Mapping[str, list[float]]) -> list[Claim]:
    """Open where no action fails, so that there is nothing to compare."""
    if not all(spikes.values()):
        return [claim.measured("no action fails in more than half of its tries", None) for claim in (SPIKES, NONE)]
    others = "; ".join(f"{e} {estimate(spikes[e])}" for e in EXPLORERS[1:])
    return [
        SPIKES.measured(estimate(spikes["curious"]), interval(spikes["curious"])[0] > SPIKE),
        NONE.measured(others, all(interval(spikes[e])[1] < SPIKE for e in EXPLORERS[1:])),
    ]


def _is_least(values: Mapping[str, list[float]]) -> bool:
    """Whether the ratio of the curious agent's to each of the others', its interval included, is below 1."""
    return all(ratio_interval(values["curious"], values[e])[1] < 1.0 and ratio(values["curious"], values[e]) < 1.0 for e in EXPLORERS[1:])


def _each(values: Mapping[str, list[float]]) -> str:
    return ", ".join(f"{explorer} {estimate(values[explorer])}" for explorer in EXPLORERS)


TITLES = {"curious": "curious (AC)", "least_tried": "least tried (LT)", "random": "random (RAND)"}


def plot(found: Cells) -> Any:
    """Visits and tries of one run of each explorer, as in fig. 5: a row an explorer."""
    grouped = groups(found)
    shown = [explorer for explorer in EXPLORERS if ("nearest", explorer) in grouped]
    drawing = new_figure(13.0, 2.4 * len(shown))
    panels = drawing.subplots(len(shown), 2, squeeze=False, sharex="col", sharey="col", width_ratios=(1, 3))
    chosen = constraint_actions(_all_runs(grouped, "nearest"))
    for (left, right), explorer in zip(panels, shown, strict=True):
        run = grouped["nearest", explorer][0]
        left.bar(np.arange(len(run.visits)), run.visits, width=1.0, color="0.4")
        left.set_ylabel(TITLES[explorer])
        number = np.arange(len(run.tries))
        right.bar(number[~chosen], run.tries[~chosen], width=1.0, color="0.6", label="others")
        right.bar(number[chosen], run.tries[chosen], width=2.5, color="C3", label="at constraints")
        right.set_xlim(-1, len(number))
    panels[0][0].set_title(f"visits of states in {run.tries.sum()} transitions", fontsize=9)
    panels[0][1].set_title("tries of state-actions (16 nearest neighbours)", fontsize=9)
    panels[0][1].legend(fontsize=8, loc="upper right")
    panels[-1][0].set_xlabel("state")
    panels[-1][1].set_xlabel("state-action")
    return drawing


EXPERIMENT = Experiment(
    name="exploration-uniformity",
    claim="curious exploration is more uniform than random and least-tried, but for spikes at the actions that meet constraints",
    source="paper 3.1, fig. 5",
    notes=__doc__,
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
