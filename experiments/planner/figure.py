"""The learned model as in fig. 7, the plans with a moving table, and how they recover when it has entered."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.arm_learning import ARM_NEIGHBOURS, RANK3, arm_space
from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from experiments.kit.statistics import interquartile_mean, interval
from experiments.planner.arrows import draw_arrows
from experiments.planner.findings import ENTERS, ROADMAPS, entering, tested
from experiments.planner.trial import TESTS
from mobee.errors import InvalidValue


def draw(done: Mapping[str, CellResult], path: Path) -> Path:
    """Two pictures of the model, one of each way of learning, and two panels; raises InvalidValue if cells are missing."""
    ways = {
        way: sorted(name for name, r in done.items() if r.cell.settings["way"] == way) for way in ("still", "moving", "enters", "roadmap")
    }
    if not all(ways.values()):
        raise InvalidValue(f"{path.parent} lacks finished cells: go on with --resume.")
    drawing = new_figure(19.0, 13.0)
    above, below = drawing.subfigures(2, 1, height_ratios=(2.0, 1.0))
    space = arm_space(RANK3, ARM_NEIGHBOURS)
    titles = {"still": "learned without the table", "moving": "learned while the table goes up and down"}
    for axes, (way, title) in zip(above.subplots(1, 2), titles.items(), strict=True):
        values = done[ways[way][0]].values
        draw_arrows(axes, space, values["outcomes"], values["probabilities"])
        axes.set_title(title, fontsize=10)
    success, met, recovering, plans = below.subplots(1, 4)
    _moving(success, done, "success", "share of queries that succeed")
    success.legend(fontsize=7)
    _moving(met, done, "met", "share of queries that meet the table")
    _entering(recovering, done, "success", "share of queries that succeed")
    _entering(plans, done, "actions", "actions a query")
    drawing.savefig(path, dpi=80)
    return path


def _moving(axes: Any, done: Mapping[str, CellResult], measure: str, label: str) -> None:
    who = [("still", "plans", "MDP, trained without it", "tab:gray"), ("moving", "plans", "MDP, trained while it moved", "tab:red")]
    who += [("roadmap", mode, f"roadmap, {mode}", color) for mode, color in zip(ROADMAPS, ("0.75", "tab:cyan", "tab:blue"), strict=True)]
    for number, (way, mode, name, color) in enumerate(who):
        values = [tested(done, way, test, measure, mode) for test in TESTS]
        means = np.array([interquartile_mean(v) for v in values])
        bounds = np.array([interval(v) for v in values])
        spread = np.maximum(np.stack([means - bounds[:, 0], bounds[:, 1] - means]), 0.0)
        axes.errorbar(np.arange(3) + 0.1 * (number - 2), means, spread, fmt="o", color=color, capsize=3, markersize=5, label=name)
    axes.set_xticks(range(3), [f"table {test}" for test in TESTS])
    axes.set(ylabel=label, xlabel="while plans are carried out")
    axes.grid(alpha=0.2)


def _entering(axes: Any, done: Mapping[str, CellResult], measure: str, label: str) -> None:
    for forgetting, color in zip(ENTERS, ("tab:blue", "tab:orange"), strict=True):
        after, rows = entering(done, forgetting)
        means = [interquartile_mean(column) for column in rows[measure].T]
        bounds = np.array([interval(column) for column in rows[measure].T])
        axes.plot(after, means, "o-", color=color, label="all is remembered" if forgetting == 1.0 else f"counts fade by {forgetting:g}")
        axes.fill_between(after, bounds[:, 0], bounds[:, 1], color=color, alpha=0.15, linewidth=0.0)
    axes.set(xlabel="transitions since the table entered", ylabel=label)
    axes.legend(fontsize=8)
    axes.grid(alpha=0.2)
