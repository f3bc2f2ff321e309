# SPDX-License-Identifier: Apache-2.0
"""Explore a hypercube of 16 states, in which every action succeeds, with the curious agent.

Claim: on the hypercube of 16 states and 64 actions all actions succeed; every action is tried at least 5 times after little more than the
smallest possible number of transitions; tries and values become uniform; and the values grow with the discount factor.
Source: thesis 7.1, figs. 7.2 and 7.3, table 7.1; the rewards of table 6.2.  Published number: 320 actions (64 x 5).
Run time: 10 seconds on 2 cores.

The states are the 16 poses with each of four joints at 25 or 75 % of its range.  The left arm, with its cable constraints and
self-contacts, explores from a random state.  Runs are made with the discounts 0.5, 0.9 and 0.99, and with both initialisations of the
counts of outcomes (50-50: one imagined failure and one success; 60-40: one failure and two successes), because thesis 7.1 names none.
Numbers are those of 50-50 unless stated otherwise.
Tries and values are recorded after 50 transitions and at the end.  The relative variance of tries is their variance divided by that of a
uniformly random choice among 64 actions: 1 for a random choice, 0 for equal tries.  The limit of the value is mean reward / (1 - discount),
the value of earning the mean reward indefinitely.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import itemgetter
from typing import Any

import numpy as np

from experiments.kit.experiment import Claim, Envelope, Experiment, Measured, claim, judged
from experiments.kit.learning.arm import HYPERCUBE, arm_plant, arm_space
from experiments.kit.learning.exploration import LeastTries, begin_anywhere, explore
from experiments.kit.learning.outcomes import first_tries, goals_of
from experiments.kit.plots import draw_stacked_bars, new_figure
from experiments.kit.rules import all_hold, decides, is_above, of_each, row
from experiments.kit.statistics import estimate, interquartile_mean, interval, ratio_interval, relative_spread
from experiments.kit.sweep import Cells, Condition, Sweep, grid, grouped_by
from mobee import CuriousAgent, value_iteration
from mobee.arrays import Array

INITIAL = ("50-50", "60-40")
DISCOUNTS = (0.5, 0.9, 0.99)
EARLY = 50  # transitions after which tries and values are recorded for the first time
MIN_TRIES = 5  # of each action, after which a run ends
MAX_TRANSITIONS = 5_000  # of a run in which an action is never possible
TOLERANCE = 1e-9  # nats, of values
PUBLISHED, TOLERANCE_ACTIONS = 320, 0.05  # actions, and the share by which they may be more
LIKE_RANDOM = (0.5, 2.0)  # relative variances of tries that count as those of a random choice
ROUGHLY = 0.5  # share by which numbers that are "roughly proportional" may differ
EQUAL_SPREAD = 0.1  # standard deviation over mean of values that count as equal

Run = Mapping[str, Any]  # the values of a cell
Groups = Mapping[float, Sequence[Run]]  # by discount
Priors = Mapping[str, Groups]  # by initialisation


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: two initialisations of the counts of outcomes, with the discounts 0.5, 0.9 and 0.99.

    "50-50": one imagined failure and one success; "60-40": one failure and two successes.  The runs are so short that --quick changes
    nothing.
    """
    return grid(initial=INITIAL, discount=DISCOUNTS)


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore the hypercube until every action was tried 5 times, at most 5050 transitions.

    Returns for the (16, 4) actions their tries and values [nats] after 50 transitions, `early_tries` and `early_values`, and at the end,
    `tries`, `values` and expected `rewards`; the transitions `seen` (T, 3), their number `transitions`, and how many of them `failed`; and
    `all_once`, the number of transitions until every action was tried once, or None if some action was not tried.  `settings`: "discount"
    and "initial", as for `CuriousAgent`.  `seed`: of agent and plant.
    """
    space, plant = arm_space(HYPERCUBE), arm_plant(seed)
    begin_anywhere(space, plant, seed)
    agent = CuriousAgent(space, plant, seed=seed, discount=settings["discount"], initial=settings["initial"])
    enough = LeastTries(MIN_TRIES, space.state_actions)
    early = explore(agent, EARLY, enough)
    values: dict[str, Any] = {"early_tries": agent.model.tries.copy(), "early_values": _values(agent)}
    seen = np.concatenate([early, explore(agent, MAX_TRANSITIONS, enough)])
    new = first_tries(space, seen)
    return values | {
        "tries": agent.model.tries.copy(),
        "values": _values(agent),
        "rewards": agent.model.reward.copy(),
        "seen": seen,
        "transitions": len(seen),
        "all_once": int(new[-1]) if len(new) == space.state_actions else None,
        "failed": int((seen[:, 2] != goals_of(space, seen)).sum()),
    }


def _values(agent: CuriousAgent) -> Array:
    """Return the values of all actions (S, A) nats under the agent's model, by value iteration with a tolerance of 1e-9 nats.

    The tolerance of the agent's own plans is larger.
    """
    return value_iteration(agent.model, agent.model.reward, agent.discount, TOLERANCE)[1]


def relative_variance(tries: Array) -> float:
    """Return the variance of the tries of actions, divided by its expected value if actions are chosen uniformly at random.

    `tries`: number of tries of each action, any shape.  0 means that all actions were tried equally often, about 1 that they were chosen at
    random.
    """
    count, total = tries.size, tries.sum()
    return float(tries.var() / (total / count * (1.0 - 1.0 / count)))


def _share_of_limit(run: Run, discount: float) -> float:
    """Return the mean value over its limit, the value of earning the mean reward indefinitely."""
    return float(run["values"].mean() * (1.0 - discount) / run["rewards"].mean())


def _every(groups: Groups, name: str) -> list[Any]:
    return [run[name] for runs in groups.values() for run in runs]


@claim("thesis 7.1", "on a hypercube of 16 states, all actions bring the arm to their goal state", "all")
def succeed(priors: Priors) -> Measured:
    failed, total = (sum(sum(_every(groups, name)) for groups in priors.values()) for name in ("failed", "transitions"))
    return f"{total - failed} of {total} actions", failed == 0


@claim(
    "thesis 7.1, fig. 7.3",
    "on the hypercube, every state-action has been tried at least 5 times after 320 actions (within 5 %)",
    "320 (= 64 x 5)",
)
def actions(priors: Priors) -> Measured:
    groups = priors[INITIAL[0]]
    made = of_each(groups, itemgetter("transitions"))
    text = "; ".join(f"{estimate(counts, 0)} at discount {discount:g}" for discount, counts in made.items())
    return text, all_hold(decides(interval(counts), most=(1.0 + TOLERANCE_ACTIONS) * PUBLISHED) for counts in made.values())


def _uniform(groups: Groups) -> Measured:
    early, end = (list(map(relative_variance, _every(groups, name))) for name in ("early_tries", "tries"))
    text = f"variance of tries over that of a random choice: {estimate(early)} after {EARLY} actions, {estimate(end)} at the end"
    return text, all_hold([decides(interval(early), *LIKE_RANDOM), is_above(early, end)])


uniform = Claim(
    "thesis 7.1, figs. 7.2, 7.3",
    "on the hypercube, tries of actions vary like those of a random choice at first, and become increasingly equal",
    "figures only",
    rule=_uniform,
    varies="prior",
    untested="how the agent chooses among equally good actions",
)


@claim("thesis 7.1, figs. 7.2, 7.3", "on the hypercube, the values of all actions become equal", "figures only")
def flat(priors: Priors) -> Measured:
    early, end = (list(map(relative_spread, _every(priors[INITIAL[0]], name))) for name in ("early_values", "values"))
    text = f"standard deviation over mean: {estimate(early)} after {EARLY} actions, {estimate(end, 3)} at the end, at most {max(end):.3f}"
    return text, all_hold([is_above(early, end), decides(interval(end), most=EQUAL_SPREAD)])


def _proportional(groups: Groups) -> Measured:
    """Judge two meanings of "proportional to the discount", for the mean value of the actions at the largest and the smallest discount.

    First, the value at the largest discount is larger.  Second, the ratio of both values differs from the ratio of both discounts by at
    most one half of the latter.  The text compares the values with their limit, mean reward / (1 - discount), too.
    """
    values = {discount: [float(run["values"].mean()) for run in runs] for discount, runs in groups.items()}
    shares = [interquartile_mean([_share_of_limit(run, discount) for run in runs]) for discount, runs in groups.items()]
    of_limit = " to ".join(dict.fromkeys(f"{share:.2f}" for share in (min(shares), max(shares))))
    low, high = min(values), max(values)
    text = (
        f"mean value {', '.join(f'{1e3 * interquartile_mean(value):.3g}' for value in values.values())} x 1e-3 nats at"
        f" {', '.join(f'{d:g}' for d in values)}: {of_limit} of mean reward / (1 - discount), to which they are proportional"
    )
    bounds = high / low * (1.0 - ROUGHLY), high / low * (1.0 + ROUGHLY)
    readings = {"growth with the discount factor": is_above(values[high], values[low])}
    readings["proportionality within one half"] = decides(ratio_interval(values[high], values[low]), *bounds)
    return text, Envelope("reading", readings)


proportional = Claim(
    "thesis 7.1, figs. 7.2, 7.3",
    "on the hypercube, values are roughly proportional to the discount factor",
    "figures only",
    rule=_proportional,
    varies="prior",
)


CLAIMS = (succeed, actions, uniform, flat, proportional)


def by_prior(found: Cells) -> Priors:
    """Group the values of the finished runs by initialisation of the counts, then by discount; each group is sorted by seed."""
    grouped = grouped_by(found, "initial", "discount")
    return {
        initial: {d: grouped[initial, d] for d in DISCOUNTS if (initial, d) in grouped}
        for initial in INITIAL
        if (initial, DISCOUNTS[0]) in grouped
    }


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with two keys, "runs" and "claims".

    "runs" is a dict from "initialisation, discount" to a row of numbers: "seeds", "actions_until_all_tried_5_times" with the ends "low" and
    "high" of its confidence interval, and others about tries and values.  "claims" is a list with the claims, their measured values and
    their verdicts, as dicts (`Claim.record`).
    """
    priors = by_prior(found)
    return {
        "runs": {f"{i}, discount {d:g}": _row(d, runs) for i, groups in priors.items() for d, runs in groups.items()},
        "claims": judged(CLAIMS, priors),
    }


def _row(discount: float, runs: Sequence[Run]) -> dict[str, Any]:
    low, high = interval([run["transitions"] for run in runs])
    columns: dict[str, Callable[[Run], float]] = {
        "actions_until_all_tried_once": lambda run: run["all_once"] or run["transitions"],
        "relative_variance_of_tries_early": lambda run: relative_variance(run["early_tries"]),
        "relative_variance_of_tries_at_end": lambda run: relative_variance(run["tries"]),
        "relative_spread_of_values": lambda run: relative_spread(run["values"]),
        "mean_value_over_its_limit": partial(_share_of_limit, discount=discount),
        "mean_value": lambda run: float(run["values"].mean()),
    }
    actions = row(runs, {"actions_until_all_tried_5_times": itemgetter("transitions")})
    return {**actions, "low": low, "high": high, **row(runs, columns), "failed_actions": sum(run["failed"] for run in runs)}


COLUMNS = (
    ("early_tries", f"tries after {EARLY} actions"),
    ("early_values", f"values after {EARLY} actions"),
    ("tries", "tries at the end"),
    ("values", "values at the end"),
)


def plot(found: Cells) -> Any:
    """Draw tries and values of every state-action with the initialisation 50-50, as in figs. 7.2 and 7.3.

    The figure has a row of panels for each discount, and a colour for each run.  Returns a matplotlib figure.
    """
    groups = by_prior(found)[INITIAL[0]]
    drawing = new_figure(14.0, 2.6 * len(groups))
    for panels, (discount, runs) in zip(drawing.subplots(len(groups), 4, squeeze=False), groups.items(), strict=True):
        for axes, (name, title) in zip(panels, COLUMNS, strict=True):
            draw_stacked_bars(axes, [np.maximum(run[name].ravel(), 0.0) for run in runs])
            axes.set_title(f"{title}, discount {discount:g}", fontsize=9)
    for axes in panels:
        axes.set_xlabel("state-action")
    return drawing


EXPERIMENT = Experiment(
    claim="on 16 states where every action succeeds, each is tried 5 times after about 320 actions, and tries and values become uniform",
    source="thesis 7.1",
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
