"""Fractions of the oracle's score against problem-tries."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from experiments.kit.statistics import interquartile_mean, interval
from experiments.reach_predictors.findings import AIMS, BETWEEN, GRID, fractions, looks
from experiments.reach_predictors.learners import LEARNERS, PUBLISHED, RECOMMENDED
from mobee.errors import InvalidValue
from mobee.robot.robot import Array

TITLES = {GRID: "the 27 targets", BETWEEN: "8 targets never tried"}


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """A panel for the targets that were tried, one for those that were not; the aims as crosses."""
    curves, at = fractions(found), looks(found)
    if not curves:
        raise InvalidValue(f"{path.parent} has no finished learner beside the oracle: it was stopped before.")
    drawing = new_figure(14.0, 5.5)
    for axes, (name, title) in zip(drawing.subplots(1, 2, sharey=True), TITLES.items(), strict=True):
        for number, learner in enumerate(LEARNERS):
            if (learner, name) in curves:
                _curve(axes, at, curves[learner, name], learner, f"C{number % 10}", "--" if number >= 10 else "-")
        wanted = [(look, least) for (other, look), least in AIMS.items() if other == name]
        axes.plot(*zip(*wanted, strict=True), "kx", markersize=9.0, label="aims")
        axes.axhline(1.0, color="k", linestyle=":", linewidth=0.8)
        axes.set(xscale="log", xlabel="problem-tries", title=title, ylim=(0.0, None))
        axes.set_xticks(at, at)
        axes.minorticks_off()
        axes.grid(alpha=0.2)
    drawing.axes[0].set_ylabel("fraction of the oracle's score")
    drawing.axes[1].legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    drawing.savefig(path, dpi=130)
    return path


def _curve(axes: Any, at: list[int], curve: Array, learner: str, color: str, style: str) -> None:
    """Interquartile means; the intervals of the recommended and of the published one."""
    middle = [interquartile_mean(column) for column in curve.T]
    axes.plot(at, middle, style, color=color, label=learner, linewidth=2.2 if learner in (RECOMMENDED, PUBLISHED) else 1.0)
    if learner in (RECOMMENDED, PUBLISHED):
        axes.fill_between(at, *np.array([interval(column) for column in curve.T]).T, color=color, alpha=0.2, linewidth=0.0)
