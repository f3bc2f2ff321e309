# SPDX-License-Identifier: Apache-2.0
"""Distances between the outcomes of the same agents offline and live: total variation of each state-action."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import load_cells
from experiments.kit.learning.live import ROBOT, ROBOTS, TASKS, space
from experiments.kit.plots import new_figure
from mobee import Lattice, load_robot
from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.store import STORE, TransitionStore

Counts = Mapping[str, Ints]  # by part: number of each outcome, (S, A, S)


@dataclass(frozen=True, slots=True)
class Distance:
    """Distance of two records over the state-actions that both have tried often enough."""

    variation: float
    """Mean total variation of a state-action, 0 to 1."""
    agree: float
    """Share of state-actions with the same most frequent outcome."""
    compared: int
    """Number of compared state-actions."""


def counts_of(seen: Ints, space: Lattice) -> Ints:
    """Count the outcomes, (S, A, S), of transitions (T, 3): state, action, state reached."""
    counts = np.zeros((*space.goals.shape, len(space)), dtype=np.intp)
    np.add.at(counts, tuple(np.asarray(seen, dtype=np.intp).T), 1)
    return counts


def variations(first: Ints, second: Ints, least: int) -> Array:
    """Return the total variation (S, A) between two tables of counts (S, A, S); NaN where one has fewer than `least` tries."""
    both = (first.sum(axis=-1) >= least) & (second.sum(axis=-1) >= least)
    apart: Array = np.where(both, 0.5 * np.abs(shares(first) - shares(second)).sum(axis=-1), np.nan)
    return apart


def shares(counts: Ints) -> Array:
    """Return the share of each outcome in the tries of its state-action, (S, A, S); 0 without tries."""
    found: Array = counts / np.maximum(counts.sum(axis=-1, keepdims=True), 1)
    return found


def distance(first: Counts, second: Counts, least: int) -> Distance:
    """Return the distance between two records of the same parts, over all their state-actions."""
    apart = np.concatenate([variations(first[part], second[part], least).ravel() for part in first])
    same = np.concatenate([(first[part].argmax(axis=-1) == second[part].argmax(axis=-1)).ravel() for part in first])
    both = np.isfinite(apart)
    if not both.any():
        return Distance(float("nan"), float("nan"), 0)
    return Distance(float(apart[both].mean()), float(same[both].mean()), int(both.sum()))


def mean(distances: Sequence[Distance]) -> Distance:
    """Return the mean of several distances."""
    rows = np.array([(one.variation, one.agree, one.compared) for one in distances])
    variation, agree, compared = rows.mean(axis=0)
    return Distance(float(variation), float(agree), round(float(compared)))


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """Distances of the live robots and the offline seeds of a task.

    An offline seed is compared with all other offline seeds together; a live robot with all offline seeds but one, averaged over
    the seed left out.
    """

    live: dict[str, Distance]
    offline: tuple[Distance, ...]
    counts: dict[str, Counts]
    """The counts of each live robot, and of all offline seeds together under "offline"."""


def compared(folder: Path, task: str, least: int) -> Compared:
    """Compare the outcomes that the live robots and the offline seeds of a run recorded for a task.

    `folder` is the folder of the run.  Raises InvalidValue if fewer than two offline seeds have finished.
    """
    results = [r for r in load_cells(folder).values() if r.cell.settings["task"] == task]
    if len(results) < 2:
        raise InvalidValue(
            f"{folder}: the task {task!r} has {len(results)} finished offline seeds, two are needed: continue with --resume."
        )
    robot, parts = load_robot(ROBOT), TASKS[task].parts
    spaces = {part: space(robot, TASKS[task], part) for part in parts}
    seeds = [{part: counts_of(result.values[f"seen_{part}"], spaces[part]) for part in parts} for result in results]
    together = {part: np.sum([seed[part] for seed in seeds], axis=0) for part in parts}
    without = [{part: together[part] - seed[part] for part in parts} for seed in seeds]
    offline = tuple(distance(seed, others, least) for seed, others in zip(seeds, without, strict=True))
    counts: dict[str, Counts] = {"offline": together}
    for name in ROBOTS:
        path = folder / task / name / STORE
        if path.exists():
            with TransitionStore(path, "") as store:
                rows = {part: np.array([(t.s, t.a, t.s_next) for t in store.load(part)]).reshape(-1, 3) for part in parts}
            counts[name] = {part: counts_of(rows[part][: results[0].cell.settings["transitions"]], spaces[part]) for part in parts}
    live = {name: mean([distance(counts[name], others, least) for others in without]) for name in counts if name in ROBOTS}
    return Compared(live, offline, counts)


COLORS = {"pybullet": "tab:red", "mujoco": "tab:green", "kinematic": "tab:blue"}


def draw_distances(tasks: Mapping[str, Compared], least: int) -> Any:
    """Draw a row for each task: the distances of live robots and offline seeds, and the success of single actions."""
    drawing = new_figure(13.0, 4.2 * len(tasks))
    panels = drawing.subplots(len(tasks), 3, squeeze=False)
    for (variation, agree, goals), (task, found) in zip(panels, tasks.items(), strict=True):
        _dots(variation, found, "variation", f"{task}: mean total variation a state-action")
        _dots(agree, found, "agree", "share with the same most frequent outcome")
        _goals(goals, task, found, least)
    return drawing


def _dots(axes: Any, found: Compared, name: str, label: str) -> None:
    offline = [getattr(one, name) for one in found.offline]
    axes.plot(np.linspace(-0.15, 0.15, len(offline)), offline, "o", color="0.5", markersize=4)
    for place, (robot, one) in enumerate(found.live.items(), start=1):
        axes.plot([place], [getattr(one, name)], "D", color=COLORS[robot])
        axes.axhspan(min(offline), max(offline), color="0.5", alpha=0.08, linewidth=0.0)
    axes.set_xticks(range(1 + len(found.live)), ["offline,\none dot per seed", *found.live], fontsize=8)
    axes.set(xlim=(-0.5, len(found.live) + 0.5), ylim=(0.0, None) if name == "variation" else (None, 1.005), ylabel=label)
    axes.grid(alpha=0.2, axis="y")


def _goals(axes: Any, task: str, found: Compared, least: int) -> None:
    """Draw the share of tries in which an action reaches its goal, live against offline."""
    robot = load_robot(ROBOT)
    rng = np.random.default_rng(0)
    for name in (name for name in ROBOTS if name in found.live):
        pairs = []
        for part in TASKS[task].parts:
            goals = space(robot, TASKS[task], part).goals[..., None]
            live, offline = found.counts[name][part], found.counts["offline"][part]
            both = (live.sum(axis=-1) >= least) & (offline.sum(axis=-1) >= least)
            reach = [np.take_along_axis(shares(counts), np.maximum(goals, 0), axis=-1)[..., 0][both] for counts in (offline, live)]
            pairs.append(np.stack(reach, axis=1))
        points = np.concatenate(pairs)
        points = points + rng.uniform(-0.02, 0.02, points.shape)  # separates equal points
        axes.plot(*points.T, ".", color=COLORS[name], markersize=4, alpha=0.4, label=f"{name}: {len(points)} state-actions")
    axes.plot([0.0, 1.0], [0.0, 1.0], color="0.5", linewidth=0.8)
    axes.set(xlabel="share that reach their goal, offline", ylabel="live", aspect="equal")
    axes.legend(fontsize=7)
    axes.grid(alpha=0.2)
