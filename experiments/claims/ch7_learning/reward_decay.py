"""Decay: how does what there is to learn get less, over state-actions and over time?

Claim: the curious agent's reward decays uniformly over the state-actions, since wherever there is a spike it goes and gets it.
Source: paper 3.1, fig. 6 (snapshots, no numbers).  Run time: 1 minute on 2 cores.

The left arm with its cable constraints and self-contacts; 81 states with 16 neighbours, one graph for all runs, 4000 transitions.
Measured: mean, largest and relative spread of the rewards of all state-actions at fixed times, for the curious agent, least-tried
and random exploration.
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

UNIFORM = Claim("paper 3.1, fig. 6", "the reward decays uniformly: largest over mean reward once everything was tried", "qualitative")
GETS_IT = Claim(
    "paper 3.1, fig. 6", "wherever the reward is high the curious agent goes and gets it: largest reward left at the end", "qualitative"
)
FASTER = Claim("paper 3.1", "curiosity leaves less to learn than the others: mean reward at the end, over theirs", "qualitative")
CLAIMS = (UNIFORM, GETS_IT, FASTER)

Groups = Mapping[str, list[dict[str, Any]]]


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Every explorer; the short version leaves the last snapshots out."""
    times = list(QUICK_TIMES if arguments.quick else TIMES)
    return [Condition(explorer, {"explorer": explorer, "times": times}) for explorer in EXPLORERS]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Explore; the rewards (snapshots, state-actions) at the times."""
    space, plant = arm_space(neighbours=ARM_NEIGHBOURS), arm_plant(seed)
    begin_anywhere(space, plant, seed)
    agent = CuriousAgent(space, plant, settings["explorer"], seed)
    snapshots = []
    for time in settings["times"]:
        explore(agent, time - agent.transitions)
        snapshots.append(agent.model.reward[space.goals >= 0])
    return {"rewards": np.array(snapshots, dtype=np.float32), "times": settings["times"]}


def findings(found: Cells) -> dict[str, Any]:
    """A row for each explorer, and the claims."""
    groups = grouped(found, "explorer", EXPLORERS)
    numbers = {"mean": np.mean, "largest": np.max}
    rows = {f"{name}, {explorer}": _row(runs, number) for explorer, runs in groups.items() for name, number in numbers.items()}
    claims = measured(groups) if len(groups) == len(EXPLORERS) else CLAIMS
    return {"runs": rows, "claims": [claim.record() for claim in claims]}


def _row(runs: list[dict[str, Any]], number: Any) -> dict[str, Any]:
    row: dict[str, Any] = {"seeds": len(runs)}
    for place, time in enumerate(runs[0]["times"]):
        row[f"after_{time}"] = round(interquartile_mean([float(number(run["rewards"][place])) for run in runs]), 5)
    return row


def measured(groups: Groups) -> list[Claim]:
    """The claims with our numbers, of the runs of all explorers."""
    last = {explorer: [run["rewards"][-1] for run in groups[explorer]] for explorer in EXPLORERS}
    peak = {explorer: [float(rewards.max() / rewards.mean()) for rewards in last[explorer]] for explorer in EXPLORERS}
    largest = {explorer: [float(rewards.max()) for rewards in last[explorer]] for explorer in EXPLORERS}
    mean = {explorer: [float(rewards.mean()) for rewards in last[explorer]] for explorer in EXPLORERS}
    others = [ratio_interval(mean["curious"], mean[explorer]) for explorer in EXPLORERS[1:]]
    against = ", ".join(f"{ratio_estimate(mean['curious'], mean[explorer])} of {explorer}'s" for explorer in EXPLORERS[1:])
    return [
        UNIFORM.measured(_each(peak, 1), _is_least(peak)),
        GETS_IT.measured(_each(largest, 4), _is_least(largest)),
        FASTER.measured(against, all(high < 1.0 for _, high in others)),
    ]


def _each(values: Mapping[str, list[float]], digits: int) -> str:
    return ", ".join(f"{explorer} {estimate(values[explorer], digits)}" for explorer in EXPLORERS)


def _is_least(values: Mapping[str, list[float]]) -> bool:
    """Whether the interval of the curious agent lies below those of the others."""
    return all(interval(values["curious"])[1] < interval(values[explorer])[0] for explorer in EXPLORERS[1:])


def plot(found: Cells) -> Any:
    """Snapshots of one run of each explorer, as published; one row a time, with the same scale along a row."""
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
                axes.set_ylabel(f"reward [nats]\nafter {time}", fontsize=8)
    for axes in panels[-1]:
        axes.set_xlabel("state-action")
    return drawing


EXPERIMENT = Experiment(
    name="reward-decay",
    claim="the curious agent's reward decays uniformly over the state-actions: wherever it is high the agent goes and gets it",
    source="paper 3.1, fig. 6",
    notes=__doc__,
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
