# SPDX-License-Identifier: Apache-2.0
"""Block three neighbouring states after learning, and compare agents that forget at a fixed rate with one that detects changes.

Claim: an agent that detects changes of outcomes by their run lengths corrects its model sooner than agents that forget at a fixed rate, and
is as accurate as one that forgets nothing in a world that does not change.
Source: aim of this reproduction; it extends thesis 7.2.6, about changed outcomes.  Published number: none.
Run time: half a minute on 2 cores.

The world is a table of outcomes: the lattice with three levels of four joints (81 states), with actions to the states one level away along
one joint; every action succeeds.  After 2000 transitions a random state and two of its neighbours are blocked: all actions towards these
states end in the state in which they began.  1000 more transitions follow.  The error of the model is the mean L1 distance between its
outcome probabilities (from the observed counts and a weak prior) and the true ones; it is computed for the actions into blocked states, and
for all other actions, without those that start in a blocked state.  In half of the runs nothing changes.  The agent that detects changes
estimates the run length of each action: the number of observations of this action since its outcomes changed last.  It forgets older
observations.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.kit.experiment import OUR_AIM, Claim, Experiment, Measured, judged
from experiments.kit.learning.arm import arm_space
from experiments.kit.plots import draw_curve, finish, new_figure
from experiments.kit.rules import all_hold, is_above, of_each, row, texts
from experiments.kit.statistics import difference_interval, estimate
from experiments.kit.sweep import Cells, Condition, Sweep, grouped_by
from mobee import CuriousAgent
from mobee.arrays import Array, Ints
from mobee.learning.tabular import TabularPlant, ideal
from mobee.learning.value_iteration import OutcomeModel

AGENTS: Mapping[str, dict[str, Any]] = {
    "forgets nothing": {},
    "forgetting .95": {"forgetting": 0.95},
    "forgetting .8": {"forgetting": 0.8},
    "run length": {"detector": "run_length"},
}
OURS, PLAIN = "run length", "forgets nothing"
BEFORE, AFTER, CHECK_PERIOD = 2000, 1000, 20  # transitions
NEIGHBOURS = 2  # of the blocked state, which are blocked too
JUDGED_AFTER = 300  # transitions
MARGIN = 0.01  # of the error in a world that does not change


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: each of four agents, in a world that changes and in one that does not.

    The agents forget nothing, forget with the factors .95 and .8, or forget the observations from before a detected change ("run length").
    With --quick the runs have a quarter of the transitions.
    """
    share, name = (4, "quick-") if arguments.quick else (1, "")
    return [
        Condition(
            f"{name}{agent.replace(' ', '-')}{'-changed' if is_changed else ''}",
            {"agent": agent, "changed": is_changed, "before": BEFORE // share, "after": AFTER // share},
        )
        for agent, is_changed in product(AGENTS, (False, True))
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Let one agent explore before and after the change, and measure the error of its model.

    Returns `errors` (checks + 1, 2), mean L1 errors against the outcomes after the change.  Row 0 is measured at the change, row i after i
    further periods of 20 transitions.  Column 0: changed actions (0 in a world that does not change); column 1: all other actions that do
    not start in a blocked state.  `tries` is the mean number of tries of a changed action since the change, divided by the mean of all
    actions that do not start in a blocked state (1 in a world that does not change).  `settings`: "agent", a key of AGENTS; "changed",
    whether the world changes; "before" and "after", numbers of transitions.  `seed`: of agent and world.
    """
    space, rng = arm_space(), np.random.default_rng([seed, 726])
    middle = int(rng.integers(len(space)))
    blocked = np.array([middle, *rng.choice(space.actions(middle), NEIGHBOURS, replace=False)]) if settings["changed"] else np.zeros(0, int)
    outcomes, chances = ideal(space)
    agent = CuriousAgent(space, TabularPlant(space, outcomes, chances, seed), seed=seed, **AGENTS[settings["agent"]])
    agent.run(settings["before"])
    after = np.where(np.isin(space.goals, blocked)[:, :, None], np.arange(len(space))[:, None, None], outcomes)
    free = np.setdiff1d(np.arange(len(space)), blocked)
    start = agent.state if agent.state in free else int(free[0])
    agent.plant = TabularPlant(space, after, chances, seed + 1000, start)
    agent.interrupt()
    reachable = np.isin(np.arange(len(space)), free)[:, None] & (space.goals >= 0)
    changed = reachable & np.isin(space.goals, blocked)
    before, errors = agent.model.tries.copy(), [_errors(agent.model.debiased(), after, changed, reachable)]
    for _ in range(settings["after"] // CHECK_PERIOD):
        agent.run(CHECK_PERIOD)
        errors.append(_errors(agent.model.debiased(), after, changed, reachable))
    tries = agent.model.tries - before
    return {"errors": np.array(errors), "tries": float(tries[changed].mean() / tries[reachable].mean()) if changed.any() else 1.0}


def _errors(beliefs: OutcomeModel, outcomes: Ints, changed: NDArray[np.bool_], reachable: NDArray[np.bool_]) -> tuple[float, float]:
    right = (beliefs.probabilities * (beliefs.outcomes == outcomes)).sum(axis=-1)  # every action has one true outcome
    error: Array = 2.0 * (1.0 - right)
    return float(error[changed].mean()) if changed.any() else 0.0, float(error[reachable & ~changed].mean())


Runs = Mapping[tuple[str, bool], list[dict[str, Any]]]  # by agent, and whether the world changed


def left(run: dict[str, Any], after: int = JUDGED_AFTER) -> float:
    """Return the error of the changed actions `after` transitions after the change, divided by their error at the change.

    `run`: result of `trial` with a change.  `after`: a multiple of 20.
    """
    return float(run["errors"][after // CHECK_PERIOD, 0] / run["errors"][0, 0])


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with two keys, "agents" and "claims".

    "agents" is a dict from each agent to a row of numbers, such as "error left after N" (transitions) and "relative tries of changed
    actions"; "claims" is a list with the claims, their measured values and their verdicts, as dicts (`Claim.record`).  If not every agent
    was run in full, there are no rows, and all claims stay unmeasured and are not judged.
    """
    runs = grouped_by(found, "agent", "changed")
    whole = len(runs) == 2 * len(AGENTS) and len(runs[OURS, True][0]["errors"]) == AFTER // CHECK_PERIOD + 1
    rows = {agent: _row(runs[agent, True], runs[agent, False]) for agent in AGENTS} if whole else {}
    return {"agents": rows, "claims": judged(CLAIMS, runs, whole)}


def _row(changed: list[dict[str, Any]], same: list[dict[str, Any]]) -> dict[str, Any]:
    points = {f"error left after {n}": partial(left, after=n) for n in (100, 200, JUDGED_AFTER, 500, AFTER)}
    return row(changed, points | {"relative tries of changed actions": lambda run: run["tries"]}) | {
        "error in a world that does not change": estimate([run["errors"][-1, 1] for run in same], 4)
    }


def _sooner(runs: Runs) -> Measured:
    values = of_each({agent: runs[agent, True] for agent in AGENTS}, left)
    return texts(values), all_hold(is_above(group, values[OURS]) for agent, group in values.items() if agent != OURS)


def _interesting(runs: Runs) -> Measured:
    values = of_each({agent: runs[agent, True] for agent in (PLAIN, OURS)}, lambda run: float(run["tries"]))
    return texts(values, 1), is_above(values[OURS], values[PLAIN])


def _as_accurate(runs: Runs) -> Measured:
    values = of_each({agent: runs[agent, False] for agent in (PLAIN, OURS)}, lambda run: float(run["errors"][-1, 1]))
    worse = difference_interval(values[OURS], values[PLAIN])[1]
    return texts(values, 4), bool(worse <= MARGIN * np.mean(values[PLAIN]))


CLAIMS = (
    Claim(
        OUR_AIM,
        "an agent that detects changes corrects its model sooner than one that forgets nothing or at a fixed rate: error of changed "
        f"outcomes {JUDGED_AFTER} transitions after a change, over that at the change",
        "less",
        rule=_sooner,
    ),
    Claim(
        OUR_AIM,
        "an agent that detects changes explores changed places more: tries of changed actions over the mean of all actions",
        "more",
        rule=_interesting,
    ),
    Claim(
        OUR_AIM,
        "in a world that does not change, an agent that detects changes is as accurate as one that forgets nothing, to 1 % of its error",
        "at most 1 % worse",
        rule=_as_accurate,
    ),
)


def plot(found: Cells) -> Any:
    """Draw the L1 error of the changed actions over the transitions since the change, a curve for each agent.

    Returns a matplotlib figure.
    """
    runs, drawing = grouped_by(found, "agent", "changed"), new_figure(7.0, 4.5)
    axes = drawing.subplots()
    for number, agent in enumerate(AGENTS):
        if group := runs.get((agent, True)):
            curves = np.array([run["errors"][:, 0] for run in group])
            draw_curve(axes, CHECK_PERIOD * np.arange(curves.shape[1]), curves, f"C{number}", agent)
    finish(axes, 8.0, xlabel="transitions since the change", ylabel="L1 error of changed actions", ylim=(0.0, None))
    return drawing


EXPERIMENT = Experiment(
    claim="an agent that detects changes by run lengths corrects its model sooner than one that forgets at a fixed rate",
    source="aim of this reproduction, to thesis 7.2.6",
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
