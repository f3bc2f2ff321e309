"""Stacked bars of tries and values, a colour a run (thesis figs. 7.6 and 7.7)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from experiments.lattice.groups import FAILING, HARD, Run, groups
from mobee.errors import InvalidValue
from mobee.robot.robot import Array


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """Rows: initialisation and discount; columns: tries and values.  Raises InvalidValue if there is nothing to draw."""
    grouped = groups(found)
    if not grouped:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(15.0, 2.3 * len(grouped))
    for row, ((initial, discount), runs) in zip(drawing.subplots(len(grouped), 2, squeeze=False), grouped.items(), strict=True):
        mean = np.mean([run.transitions for run in runs])
        _bars(row[0], runs, [run.tries for run in runs])
        row[0].set_title(f"tries, {initial}, discount {discount:g}: {len(runs)} runs of {mean:.0f} actions on average", fontsize=9)
        _bars(row[1], runs, [np.maximum(run.values, 0.0) for run in runs])
        row[1].set_title(f"values, {initial}, discount {discount:g}", fontsize=9)
    for axes in row:
        axes.set_xlabel("state-action; grey: those of states 24, 51, 78; triangles: the failing 15->24, 42->51, 69->78")
    drawing.savefig(path, dpi=150)
    return path


def _bars(axes: Any, runs: list[Run], given: list[Array]) -> None:
    """One bar a state-action, by source state; each run adds a piece in its colour."""
    exists = runs[0].exists
    number = np.cumsum(exists.ravel()).reshape(exists.shape) - 1
    bottom = np.zeros(int(exists.sum()))
    for values in given:
        heights = values[exists].astype(float)
        axes.bar(np.arange(len(heights)), heights, bottom=bottom, width=1.0)
        bottom += heights
    for state in HARD:
        mine = number[state][exists[state]]
        axes.axvspan(mine[0] - 0.5, mine[-1] + 0.5, color="0.8", zorder=0)
    at = [number[runs[0].index(pair)] for pair in FAILING]
    axes.plot(at, bottom[at] + 0.04 * bottom.max(), "kv", markersize=4)
    axes.set_xlim(-0.5, len(bottom) - 0.5)
    axes.tick_params(labelsize=7)
