# SPDX-License-Identifier: Apache-2.0
"""Measure how uniformly three explorers visit states and try actions, and how often they try failing actions.

Claim: after 4000 transitions the curious agent's visits of states and tries of state-actions are more uniform than those of random and
least-tried exploration, except for spikes at the actions that run into constraints.
Source: paper 3.1, fig. 5 (one run of the real robot per explorer).  No numbers are published.  Run time: 2 minutes on 2 cores.

The left arm, with its cable constraints and self-contacts, has 81 states.  Actions lead to the 16 nearest states; in other runs, for
comparison, to the equidistant neighbours, the states one level away along one joint.  Ties among the 16 nearest are drawn once: all runs
share that graph, and the numbers may depend on it.  Actions at constraints are those that failed in more than half of all their tries, in
the runs of all explorers on a graph together.  When a run is judged, its own tries are left out.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from functools import cache, partial
from itertools import product
from typing import Any

import numpy as np

from experiments.kit.experiment import OUR_AIM, Claim, Experiment, Measured, Rule, claim, judged
from experiments.kit.learning.arm import ARM_NEIGHBOURS, arm_plant, arm_space
from experiments.kit.learning.exploration import begin_anywhere, explore
from experiments.kit.learning.outcomes import Explored, Groups, constraint_actions, draw_tries, explored, in_order, relative_tries_of
from experiments.kit.plots import draw_heights, new_figure
from experiments.kit.rules import all_hold, decides, of_each, row, stands_below, texts, within
from experiments.kit.statistics import estimate, gini, interquartile_mean, interval, ratio_interval, relative_spread
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import CuriousAgent, Lattice

EXPLORERS = ("curious", "least_tried", "random")
GRAPHS = ("nearest", "equidistant")
TRANSITIONS, FEW = 4000, 1500
SPIKE = 1.5  # ratio of tries at constraints to tries of other actions that counts as a spike
AS_UNIFORM = 1.1  # ratio of Gini coefficients up to which one counts as no less uniform


@cache
def space_of(graph: str) -> Lattice:
    """Return the lattice of 81 states of the left arm.

    `graph`: "nearest": the neighbours of a state are the 16 nearest states; "equidistant": the states one level away along one joint.
    """
    return arm_space(neighbours=ARM_NEIGHBOURS if graph == "nearest" else "equidistant")


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: every explorer on every graph.

    With --quick the runs have 1500 transitions instead of 4000.
    """
    count = FEW if arguments.quick else TRANSITIONS
    return [
        Condition(f"{graph}-{explorer}-n{count}", {"graph": graph, "explorer": explorer, "transitions": count})
        for graph, explorer in product(GRAPHS, EXPLORERS)
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore one graph with one explorer; returns the transitions `seen` (T, 3): state, action, state reached.

    `settings`: "graph", one of GRAPHS; "explorer", the rule by which the agent chooses actions, one of EXPLORERS; "transitions", their
    number.  `seed`: of agent and plant.
    """
    space, plant = space_of(settings["graph"]), arm_plant(seed)
    begin_anywhere(space, plant, seed)
    agent = CuriousAgent(space, plant, settings["explorer"], seed)
    return {"seen": explore(agent, settings["transitions"]).astype(np.uint16)}


def summary(values: dict[str, Any]) -> dict[str, Any]:
    """Reduce the values of `trial` for the raw record: the transitions `seen` are sorted, because only their counts are needed.

    The raw record is an archive of the run's files in the repository.
    """
    return {"seen": in_order(values["seen"])}


def groups(found: Cells) -> Groups:
    """Group the counts (tries, failures and visits) of the finished runs by (graph, explorer); each group is sorted by seed."""
    return explored(found, space_of, "graph", "explorer")


def _of_graph(grouped: Groups, graph: str) -> dict[str, list[Explored]]:
    return {explorer: grouped[graph, explorer] for explorer in EXPLORERS if (graph, explorer) in grouped}


def _spikes(grouped: Groups, graph: str, explorer: str) -> list[float]:
    """Return for each run of an explorer the mean tries of actions at constraints, divided by the mean tries of all other actions.

    An action is at a constraint if it failed in more than half of its tries in all other runs on the graph, by any explorer.  Runs without
    a finite ratio are left out.
    """
    return relative_tries_of(grouped[graph, explorer], sum(_of_graph(grouped, graph).values(), []))


def _more_uniform(what: str, number: Callable[[Explored], float], grouped: Groups) -> Measured:
    """Judge whether a measure of unevenness is lower for the curious agent than for the other explorers, on the graph "nearest".

    `number`: function that computes the measure from a run; its means over the runs are compared.  `what`: its name in the text.
    """
    values = of_each(_of_graph(grouped, "nearest"), number)
    return f"{what}: {texts(values)}", stands_below(values, "curious")


_FIG5 = "paper 3.1, fig. 5"
_MORE = "more uniformly than the least-tried and the random explorer (one graph)"
visits = Claim(
    _FIG5,
    f"the curious agent visits states {_MORE}",
    "qualitative",
    rule=partial(_more_uniform, "standard deviation over mean", lambda run: relative_spread(run.visits)),
)
tries = Claim(
    _FIG5,
    f"the curious agent tries state-actions {_MORE}",
    "qualitative",
    rule=partial(_more_uniform, "Gini coefficient", lambda run: gini(run.tries)),
)


def _of_spikes(rule: Rule) -> Rule:
    """Decorator: turn a rule about ratios of tries into a rule about the grouped runs.

    `rule` gets a dict from the explorer to one ratio for each run: the mean tries of actions that run into constraints (that fail in more
    than half of their tries) over those of other actions.  If an explorer has no ratio, the outcome is None (not decided).
    """

    def of_runs(grouped: Groups) -> Measured | None:
        spikes = {explorer: _spikes(grouped, "nearest", explorer) for explorer in EXPLORERS}
        return rule(spikes) if all(spikes.values()) else ("no action fails in more than half of its tries", None)

    return of_runs


@claim(
    _FIG5,
    "the curious agent tries actions that run into constraints more often than other actions (1.5 times): ratio of mean tries (one graph)",
    "spikes",
)
@_of_spikes
def some(spikes: Mapping[str, list[float]]) -> Measured:
    return within(spikes["curious"], least=SPIKE)


@claim(
    _FIG5,
    "the least-tried and the random explorer do not try actions that run into constraints more often (less than 1.5 times)",
    "none visible",
)
@_of_spikes
def none(spikes: Mapping[str, list[float]]) -> Measured:
    others = "; ".join(f"{other.replace('_', ' ')} {estimate(spikes[other])}" for other in EXPLORERS[1:])
    return f"ratio of mean tries: {others}", all_hold(decides(interval(spikes[other]), most=SPIKE) for other in EXPLORERS[1:])


@claim(
    OUR_AIM,
    "fig. 5 depends on its graph: with equidistant neighbours the least-tried explorer tries actions as uniformly as the curious one",
    "-",
)
def same(grouped: Groups) -> Measured:
    values = of_each(_of_graph(grouped, "equidistant"), lambda run: gini(run.tries))
    return f"Gini coefficient: {texts(values)}", decides(ratio_interval(values["least_tried"], values["curious"]), most=AS_UNIFORM)


CLAIMS = (visits, tries, some, none, same)
COLUMNS: dict[str, Callable[[Explored], float]] = {
    "relative_spread_of_tries": lambda run: relative_spread(run.tries),
    "gini_coefficient_of_tries": lambda run: gini(run.tries),
}


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with two keys, "runs" and "claims".

    "runs" is a dict from "graph, explorer" to a row of numbers, such as "seeds", "relative_spread_of_tries", "fewest_tries" and
    "most_tries" of a state-action.  "claims" is a list with the claims, their measured values and their verdicts, as dicts
    (`Claim.record`).  If not every explorer was run on every graph, all claims stay unmeasured and are not judged.
    """
    grouped, rows = groups(found), {}
    for (graph, explorer), runs in grouped.items():
        spikes = _spikes(grouped, graph, explorer)
        rows[f"{graph}, {explorer}"] = row(runs, COLUMNS) | {
            "fewest_tries": min(int(run.tries.min()) for run in runs),
            "most_tries": max(int(run.tries.max()) for run in runs),
            "relative_spread_of_visits": interquartile_mean([relative_spread(run.visits) for run in runs]),
            "tries_at_constraints_over_others": interquartile_mean(spikes) if spikes else None,
            "actions_at_constraints": int(constraint_actions(sum(_of_graph(grouped, graph).values(), [])).sum()),
        }
    return {"runs": rows, "claims": judged(CLAIMS, grouped, set(product(GRAPHS, EXPLORERS)) <= set(grouped))}


TITLES = {"curious": "curious (AC)", "least_tried": "least tried (LT)", "random": "random (RAND)"}


def plot(found: Cells) -> Any:
    """Draw the visits of all states and the tries of all actions in one run of each explorer, as in fig. 5.

    The figure has a row of panels for each explorer, on the graph of the 16 nearest neighbours.  Returns a matplotlib figure.
    """
    shown = _of_graph(groups(found), "nearest")
    drawing = new_figure(13.0, 2.4 * len(shown))
    panels = drawing.subplots(len(shown), 2, squeeze=False, sharex="col", sharey="col", width_ratios=(1, 3))
    chosen = constraint_actions(sum(shown.values(), []))
    for (left, right), (explorer, (run, *_)) in zip(panels, shown.items(), strict=True):
        draw_heights(left, run.visits, color="0.4")
        left.set_ylabel(TITLES[explorer])
        draw_tries(right, run.tries, chosen, 2.5, "at constraints")
        right.set_xlim(-1, len(run.tries))
    panels[0][0].set_title(f"visits of states in {run.tries.sum()} transitions", fontsize=9)
    panels[0][1].set_title("tries of state-actions (16 nearest neighbours)", fontsize=9)
    panels[0][1].legend(fontsize=8, loc="upper right")
    panels[-1][0].set_xlabel("state")
    panels[-1][1].set_xlabel("state-action")
    return drawing


EXPERIMENT = Experiment(
    claim="curious exploration is more uniform than random and least-tried, except for spikes at actions that run into constraints",
    source="paper 3.1, fig. 5",
    method=Sweep(conditions, trial, findings, plot, summary=summary),
    claims=CLAIMS,
)
