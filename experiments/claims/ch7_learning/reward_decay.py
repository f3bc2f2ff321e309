# SPDX-License-Identifier: Apache-2.0
"""Measure how the expected rewards of all state-actions decay while an agent explores.

Claim: the curious agent's reward decays uniformly over the state-actions, because the agent goes wherever the reward is high.
Source: paper 3.1, fig. 6 (snapshots, no numbers).  Run time: 1 minute on 2 cores.

The left arm with its cable constraints and self-contacts; 81 states with 16 neighbours, one graph for all runs, 4000 transitions.
Measured are the mean and the largest reward of all state-actions after fixed numbers of transitions, for curious, least-tried and random
exploration.  The reward is the information gain that the model expects of an action.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.kit.experiment import Claim, Experiment
from experiments.kit.learning.arm import ARM_NEIGHBOURS, arm_plant, arm_space
from experiments.kit.learning.exploration import begin_anywhere, explore
from experiments.kit.plots import new_figure
from experiments.kit.statistics import estimate, interquartile_mean, interval, ratio_estimate, ratio_interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped
from mobee import CuriousAgent

EXPLORERS = ("curious", "least_tried", "random")
TIMES = (250, 500, 1000, 2000, 4000)  # transitions
QUICK_TIMES = TIMES[:3]

UNIFORM = Claim(
    "paper 3.1, fig. 6",
    "the curious agent's reward decays more uniformly than that of the other explorers: largest over mean reward at the end",
    "qualitative",
)
COLLECTED = Claim(
    "paper 3.1, fig. 6",
    "the curious agent goes wherever the reward is high, the other explorers do not: largest remaining reward at the end",
    "qualitative",
)
FASTER = Claim(
    "paper 3.1",
    "the curious agent leaves less to learn: its mean remaining reward at the end over that of the other explorers",
    "qualitative",
)
CLAIMS = (UNIFORM, COLLECTED, FASTER)

Groups = Mapping[str, list[dict[str, Any]]]


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return one condition per explorer; the short version leaves out the last two times."""
    times = list(QUICK_TIMES if arguments.quick else TIMES)
    return [Condition(explorer, {"explorer": explorer, "times": times}) for explorer in EXPLORERS]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore; returns the rewards (times, state-actions) after given numbers of transitions."""
    space, plant = arm_space(neighbours=ARM_NEIGHBOURS), arm_plant(seed)
    begin_anywhere(space, plant, seed)
    agent = CuriousAgent(space, plant, settings["explorer"], seed)
    snapshots = []
    for time in settings["times"]:
        explore(agent, time - agent.transitions)
        snapshots.append(agent.model.reward[space.goals >= 0])
    return {"rewards": np.array(snapshots, dtype=np.float32), "times": settings["times"]}


def findings(found: Cells) -> dict[str, Any]:
    """Return a row for each explorer, and the claims."""
    groups = grouped(found, "explorer", EXPLORERS)
    numbers = {"mean": np.mean, "largest": np.max}
    rows = {
        f"{name} reward, {explorer.replace('_', ' ')}": _row(runs, number)
        for explorer, runs in groups.items()
        for name, number in numbers.items()
    }
    claims = measured(groups) if len(groups) == len(EXPLORERS) else CLAIMS
    return {"runs": rows, "claims": [claim.record() for claim in claims]}


def _row(runs: list[dict[str, Any]], number: Any) -> dict[str, Any]:
    row: dict[str, Any] = {"seeds": len(runs)}
    for place, time in enumerate(runs[0]["times"]):
        row[f"after_{time}_transitions"] = round(interquartile_mean([float(number(run["rewards"][place])) for run in runs]), 5)
    return row


def measured(groups: Groups) -> list[Claim]:
    """Return the claims with our numbers, from the runs of all explorers."""
    last = {explorer: [run["rewards"][-1] for run in groups[explorer]] for explorer in EXPLORERS}
    peak = {explorer: [float(rewards.max() / rewards.mean()) for rewards in last[explorer]] for explorer in EXPLORERS}
    largest = {explorer: [float(rewards.max()) for rewards in last[explorer]] for explorer in EXPLORERS}
    mean = {explorer: [float(rewards.mean()) for rewards in last[explorer]] for explorer in EXPLORERS}
    others = [ratio_interval(mean["curious"], mean[explorer]) for explorer in EXPLORERS[1:]]
    against = ", ".join(
        f"over {explorer.replace('_', ' ')} {ratio_estimate(mean['curious'], mean[explorer])}" for explorer in EXPLORERS[1:]
    )
    return [
        UNIFORM.measured(_each(peak, 1), _is_least(peak)),
        COLLECTED.measured(_each(largest, 4), _is_least(largest)),
        FASTER.measured(against, all(high < 1.0 for _, high in others)),
    ]


def _each(values: Mapping[str, list[float]], digits: int) -> str:
    return ", ".join(f"{explorer.replace('_', ' ')} {estimate(values[explorer], digits)}" for explorer in EXPLORERS)


def _is_least(values: Mapping[str, list[float]]) -> bool:
    """Return whether the interval of the curious agent lies below those of the others."""
    return all(interval(values["curious"])[1] < interval(values[explorer])[0] for explorer in EXPLORERS[1:])


def plot(found: Cells) -> Any:
    """Draw the rewards of one run of each explorer (fig. 6): one row per time, with one scale per row."""
    groups = grouped(found, "explorer", EXPLORERS)
    times = next(iter(groups.values()))[0]["times"]
    drawing = new_figure(5.0 * len(groups), 1.7 * len(times))
    panels = drawing.subplots(len(times), len(groups), squeeze=False, sharex=True, sharey="row")
    for column, (explorer, runs) in enumerate(groups.items()):
        for row, time in enumerate(times):
            rewards, axes = runs[0]["rewards"][row], panels[row][column]
            axes.bar(np.arange(len(rewards)), rewards, width=1.0, color="C0")
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
    name="reward-decay",
    claim="the curious agent's reward decays uniformly over the state-actions, because the agent goes wherever it is high",
    source="paper 3.1, fig. 6",
    notes=__doc__,
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
