# SPDX-License-Identifier: Apache-2.0
"""Measure how uniformly three explorers visit states and try actions, and how often they try failing actions.

Claim: after 4000 transitions the curious agent's visits of states and tries of state-actions are more uniform than those of random and
least-tried exploration, except for spikes at the actions that run into constraints.
Source: paper 3.1, fig. 5 (one run of the real robot per explorer).  No numbers are published.  Run time: 2 minutes on 2 cores.

The left arm with its cable constraints and self-contacts; 81 states with actions to their 16 nearest neighbours, and for comparison to
their equidistant ones.  Ties among the 16 nearest are drawn once: all runs share that graph, and the numbers may depend on it.  Actions at
constraints are those that fail in more than half of the tries of all explorers together, without the tries of the run that is judged.
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
SPIKE = 1.5  # ratio of tries at constraints to tries of other actions that counts as a spike
AS_UNIFORM = 1.1  # ratio of Gini coefficients up to which one counts as no less uniform

VISITS = Claim(
    "paper 3.1, fig. 5",
    "the curious agent visits states more uniformly than the least-tried and the random explorer (one graph)",
    "qualitative",
)
TRIES = Claim(
    "paper 3.1, fig. 5",
    "the curious agent tries state-actions more uniformly than the least-tried and the random explorer (one graph)",
    "qualitative",
)
SPIKES = Claim(
    "paper 3.1, fig. 5",
    "the curious agent tries actions that run into constraints more often than other actions: ratio of mean tries (one graph)",
    "spikes",
)
NONE = Claim(
    "paper 3.1, fig. 5", "the least-tried and the random explorer do not try actions that run into constraints more often", "none visible"
)
SAME = Claim(
    "aim of this reproduction",
    "fig. 5 depends on its graph: with equidistant neighbours the least-tried explorer tries actions as uniformly as the curious one",
    "-",
)
CLAIMS = (VISITS, TRIES, SPIKES, NONE, SAME)


@cache
def space_of(graph: str) -> Lattice:
    """Return the lattice of a graph."""
    return arm_space(neighbours=ARM_NEIGHBOURS if graph == "nearest" else "equidistant")


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return every explorer on every graph; the short version makes fewer transitions."""
    count = FEW if arguments.quick else TRANSITIONS
    return [
        Condition(f"{graph}-{explorer}-n{count}", {"graph": graph, "explorer": explorer, "transitions": count})
        for graph, explorer in product(GRAPHS, EXPLORERS)
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore; returns the transitions (T, 3)."""
    space, plant = space_of(settings["graph"]), arm_plant(seed)
    begin_anywhere(space, plant, seed)
    agent = CuriousAgent(space, plant, settings["explorer"], seed)
    return {"seen": explore(agent, settings["transitions"]).astype(np.uint16)}


def groups(found: Cells) -> Groups:
    """Return the runs of each graph and explorer, by seed."""
    return explored(found, space_of, "graph", "explorer")


def findings(found: Cells) -> dict[str, Any]:
    """Return a row for each graph and explorer, and the claims."""
    grouped = groups(found)
    rows = {f"{graph}, {explorer}": _row(grouped, graph, explorer) for graph, explorer in grouped}
    complete = all((graph, explorer) in grouped for graph in GRAPHS for explorer in EXPLORERS)
    return {"runs": rows, "claims": [claim.record() for claim in (measured(grouped) if complete else CLAIMS)]}


def _row(grouped: Groups, graph: str, explorer: str) -> dict[str, Any]:
    runs, spikes = grouped[graph, explorer], _spikes(grouped, graph, explorer)
    return {
        "seeds": len(runs),
        "relative_spread_of_tries": mean_over(runs, lambda run: relative_spread(run.tries)),
        "gini_coefficient_of_tries": mean_over(runs, lambda run: gini(run.tries)),
        "fewest_tries": min(int(run.tries.min()) for run in runs),
        "most_tries": max(int(run.tries.max()) for run in runs),
        "relative_spread_of_visits": mean_over(runs, lambda run: relative_spread(run.visits)),
        "tries_at_constraints_over_others": interquartile_mean(spikes) if spikes else None,
        "actions_at_constraints": int(constraint_actions(_all_runs(grouped, graph)).sum()),
    }


def _all_runs(grouped: Groups, graph: str) -> list[Explored]:
    return [run for explorer in EXPLORERS for run in grouped.get((graph, explorer), [])]


def _spikes(grouped: Groups, graph: str, explorer: str) -> list[float]:
    """Return for each run the mean tries of actions at constraints, as the other runs found them, over those of other actions."""
    return relative_tries_of(grouped[graph, explorer], _all_runs(grouped, graph))


def measured(grouped: Groups) -> list[Claim]:
    """Return the claims with our numbers, from the runs of all explorers on both graphs."""
    visits = {e: [relative_spread(run.visits) for run in grouped["nearest", e]] for e in EXPLORERS}
    tries = {e: [gini(run.tries) for run in grouped["nearest", e]] for e in EXPLORERS}
    other = {e: [gini(run.tries) for run in grouped["equidistant", e]] for e in EXPLORERS}
    return [
        VISITS.measured(f"standard deviation over mean: {_each(visits)}", _is_least(visits)),
        TRIES.measured(f"Gini coefficient: {_each(tries)}", _is_least(tries)),
        *_spike_claims({e: _spikes(grouped, "nearest", e) for e in EXPLORERS}),
        SAME.measured(
            f"Gini coefficient: {_each(other)}", decides(ratio_interval(other["least_tried"], other["curious"]), most=AS_UNIFORM)
        ),
    ]


def _spike_claims(spikes: Mapping[str, list[float]]) -> list[Claim]:
    """Judge tries at constraints; open where no action fails."""
    if not all(spikes.values()):
        return [claim.measured("no action fails in more than half of its tries", None) for claim in (SPIKES, NONE)]
    others = "; ".join(f"{e.replace('_', ' ')} {estimate(spikes[e])}" for e in EXPLORERS[1:])
    return [
        SPIKES.measured(estimate(spikes["curious"]), interval(spikes["curious"])[0] > SPIKE),
        NONE.measured(f"ratio of mean tries: {others}", all(interval(spikes[e])[1] < SPIKE for e in EXPLORERS[1:])),
    ]


def _is_least(values: Mapping[str, list[float]]) -> bool:
    """Return whether the ratio of the curious agent's numbers to those of each other explorer is below 1, with its interval."""
    return all(ratio_interval(values["curious"], values[e])[1] < 1.0 and ratio(values["curious"], values[e]) < 1.0 for e in EXPLORERS[1:])


def _each(values: Mapping[str, list[float]]) -> str:
    return ", ".join(f"{explorer.replace('_', ' ')} {estimate(values[explorer])}" for explorer in EXPLORERS)


TITLES = {"curious": "curious (AC)", "least_tried": "least tried (LT)", "random": "random (RAND)"}


def plot(found: Cells) -> Any:
    """Draw visits and tries of one run of each explorer, as in fig. 5: one row per explorer."""
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
    claim="curious exploration is more uniform than random and least-tried, except for spikes at actions that run into constraints",
    source="paper 3.1, fig. 5",
    notes=__doc__,
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
