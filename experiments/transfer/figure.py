"""How far live robots and offline seeds are from the offline seeds together, and action by action."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.plots import new_figure
from experiments.transfer.comparing import shares
from experiments.transfer.live import ROBOTS
from experiments.transfer.records import Compared
from experiments.transfer.settings import ROBOT, TASKS, space
from mobee import load_robot

COLORS = {"pybullet": "tab:red", "kinematic": "tab:blue"}


def draw(tasks: Mapping[str, Compared], least: int, path: Path) -> Path:
    """A row a task."""
    drawing = new_figure(13.0, 4.2 * len(tasks))
    panels = drawing.subplots(len(tasks), 3, squeeze=False)
    for (variation, agree, goals), (task, found) in zip(panels, tasks.items(), strict=True):
        _dots(variation, found, "variation", f"{task}: mean total variation a state-action")
        _dots(agree, found, "agree", "share with the same most frequent outcome")
        _goals(goals, task, found, least)
    drawing.savefig(path, dpi=130)
    return path


def _dots(axes: Any, found: Compared, name: str, label: str) -> None:
    offline = [getattr(one, name) for one in found.offline]
    axes.plot(np.linspace(-0.15, 0.15, len(offline)), offline, "o", color="0.5", markersize=4)
    for place, (robot, one) in enumerate(found.live.items(), start=1):
        axes.plot([place], [getattr(one, name)], "D", color=COLORS[robot])
        axes.axhspan(min(offline), max(offline), color="0.5", alpha=0.08, linewidth=0.0)
    axes.set_xticks(range(1 + len(found.live)), ["offline,\na dot a seed", *found.live], fontsize=8)
    axes.set(xlim=(-0.5, len(found.live) + 0.5), ylim=(0.0, None) if name == "variation" else (None, 1.005), ylabel=label)
    axes.grid(alpha=0.2, axis="y")


def _goals(axes: Any, task: str, found: Compared, least: int) -> None:
    """How often actions reach their goal, live against offline."""
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
        points = points + rng.uniform(-0.02, 0.02, points.shape)  # many lie on each other
        axes.plot(*points.T, ".", color=COLORS[name], markersize=4, alpha=0.4, label=f"{name}: {len(points)} state-actions")
    axes.plot([0.0, 1.0], [0.0, 1.0], color="0.5", linewidth=0.8)
    axes.set(xlabel="share that reach their goal, offline", ylabel="live", aspect="equal")
    axes.legend(fontsize=7)
    axes.grid(alpha=0.2)
