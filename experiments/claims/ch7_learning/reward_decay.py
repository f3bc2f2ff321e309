# SPDX-License-Identifier: Apache-2.0
"""Measure how the expected rewards of all state-actions decay while an agent explores.

Claim: the curious agent's reward decays uniformly over the state-actions, because the agent goes wherever the reward is high.
Source: paper 3.1, fig. 6 (snapshots, no numbers).  Run time: 1 minute on 2 cores.

The left arm, with its cable constraints and self-contacts, makes 4000 transitions between 81 states with 16 neighbours each, on the same
graph in all runs.  The mean and the largest reward of all state-actions are measured after fixed numbers of transitions, for curious,
least-tried and random exploration.  The reward is the information gain that the model expects of an action.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from experiments.kit.experiment import Claim, Experiment, Measured, claim, judged
from experiments.kit.learning.arm import ARM_NEIGHBOURS, arm_plant, arm_space
from experiments.kit.learning.exploration import begin_anywhere, explore
from experiments.kit.plots import draw_heights, new_figure
from experiments.kit.rules import of_each, stands_below, texts
from experiments.kit.statistics import interquartile_mean, ratio_estimate
from experiments.kit.sweep import Cells, Condition, Sweep, grouped
from mobee import CuriousAgent

EXPLORERS = ("curious", "least_tried", "random")
TIMES = (250, 500, 1000, 2000, 4000)  # transitions
QUICK_TIMES = TIMES[:3]

Groups = Mapping[str, list[dict[str, Any]]]


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: one for each explorer.

    With --quick the runs have 1000 instead of 4000 transitions.
    """
    times = list(QUICK_TIMES if arguments.quick else TIMES)
    return [Condition(explorer, {"explorer": explorer, "times": times}) for explorer in EXPLORERS]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore with one explorer, and record the expected reward [nats] of every action after each number of transitions in `times`.

    Returns `rewards` (times, actions) and `times`.  `settings`: "explorer", the rule by which the agent chooses actions, one of EXPLORERS;
    "times", a list of numbers of transitions.  `seed`: of agent and plant.
    """
    space, plant = arm_space(neighbours=ARM_NEIGHBOURS), arm_plant(seed)
    begin_anywhere(space, plant, seed)
    agent = CuriousAgent(space, plant, settings["explorer"], seed)
    snapshots = []
    for time in settings["times"]:
        explore(agent, time - agent.transitions)
        snapshots.append(agent.model.reward[space.goals >= 0])
    return {"rewards": np.array(snapshots, dtype=np.float32), "times": settings["times"]}


def _least(number: Any, digits: int, groups: Groups) -> Measured:
    """Judge whether a number, such as the largest reward, is lower for the curious agent than for the other explorers.

    `number`: function that computes it from the expected rewards of all actions at the end of a run, (actions,) nats.  `digits`: decimals
    in the text.
    """
    values = of_each(groups, lambda run: float(number(run["rewards"][-1])))
    return texts(values, digits), stands_below(values, "curious")


uniform = Claim(
    "paper 3.1, fig. 6",
    "the curious agent's reward decays more uniformly than that of the other explorers: largest over mean reward at the end",
    "qualitative",
    rule=partial(_least, lambda rewards: rewards.max() / rewards.mean(), 1),
)
collected = Claim(
    "paper 3.1, fig. 6",
    "the curious agent goes wherever the reward is high, the other explorers do not: largest remaining reward at the end",
    "qualitative",
    rule=partial(_least, np.max, 4),
)


@claim(
    "paper 3.1",
    "the curious agent leaves less to learn: its mean remaining reward at the end over that of the other explorers",
    "qualitative",
)
def faster(groups: Groups) -> Measured:
    left = of_each(groups, lambda run: float(run["rewards"][-1].mean()))
    text = ", ".join(f"over {other.replace('_', ' ')} {ratio_estimate(left['curious'], left[other])}" for other in EXPLORERS[1:])
    return text, stands_below(left, "curious")


CLAIMS = (uniform, collected, faster)


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with two keys, "runs" and "claims".

    "runs" is a dict with two rows for each explorer: one for the mean and one for the largest reward of all actions.  A row has the number
    of runs ("seeds"), and this reward [nats] after each measured number of transitions ("after_N_transitions").  "claims" is a list with
    the claims, their measured values and their verdicts, as dicts (`Claim.record`).  If not every explorer was run, all claims stay
    unmeasured and are not judged.
    """
    groups = grouped(found, "explorer", EXPLORERS)
    rows: dict[str, Any] = {}
    for explorer, runs in groups.items():
        rewards = np.array([run["rewards"] for run in runs])  # (seeds, times, state-actions)
        for name, number in {"mean": rewards.mean(axis=2), "largest": rewards.max(axis=2)}.items():
            after = {
                f"after_{time}_transitions": round(interquartile_mean(n), 5) for time, n in zip(runs[0]["times"], number.T, strict=True)
            }
            rows[f"{name} reward, {explorer.replace('_', ' ')}"] = {"seeds": len(runs), **after}
    return {"runs": rows, "claims": judged(CLAIMS, groups, len(groups) == len(EXPLORERS))}


def plot(found: Cells) -> Any:
    """Draw the rewards of all actions in one run of each explorer (fig. 6): a row of panels for each time, with one scale per row.

    Returns a matplotlib figure.
    """
    groups = grouped(found, "explorer", EXPLORERS)
    times = next(iter(groups.values()))[0]["times"]
    drawing = new_figure(5.0 * len(groups), 1.7 * len(times))
    panels = drawing.subplots(len(times), len(groups), squeeze=False, sharex=True, sharey="row")
    for column, (explorer, runs) in enumerate(groups.items()):
        for row, time in enumerate(times):
            rewards, axes = runs[0]["rewards"][row], panels[row][column]
            draw_heights(axes, rewards, color="C0")
            axes.axhline(rewards.mean(), color="C3", linewidth=0.8)
            axes.set_xlim(-0.5, len(rewards) - 0.5)
            axes.tick_params(labelsize=7)
            if row == 0:
                axes.set_title(explorer.replace("_", " ") + " (red: mean)", fontsize=9)
            if column == 0:
                axes.set_ylabel(f"reward [nats]\nafter {time} transitions", fontsize=8)
    for axes in panels[-1]:
        axes.set_xlabel("state-action")
    return drawing


EXPERIMENT = Experiment(
    claim="the curious agent's reward decays uniformly over the state-actions, because the agent goes wherever it is high",
    source="paper 3.1, fig. 6",
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
