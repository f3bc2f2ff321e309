"""Stacked bars of tries and values, a colour a run (thesis figs. 7.2 and 7.3)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.hypercube.findings import EARLY, groups
from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from mobee.errors import InvalidValue


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """Rows: discounts; columns: tries and values, early and at the end.  Raises InvalidValue if there is nothing to draw."""
    grouped = groups(found)
    if not grouped:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(14.0, 2.6 * len(grouped))
    columns = (
        ("early_tries", f"tries after {EARLY} actions"),
        ("early_values", "value"),
        ("tries", "tries at the end"),
        ("values", "value"),
    )
    for row, (discount, values) in zip(drawing.subplots(len(grouped), 4, squeeze=False), grouped.items(), strict=True):
        for axes, (name, title) in zip(row, columns, strict=True):
            stacked_bars(axes, [one[name] for one in values])
            axes.set_title(f"{title}, discount {discount:g}", fontsize=9)
    for axes in row:
        axes.set_xlabel("state-action")
    drawing.savefig(path, dpi=150)
    return path


def stacked_bars(axes: Any, runs: list[np.ndarray]) -> None:
    """One bar a state-action, by source state; each run adds a piece in its colour."""
    bottom = np.zeros(runs[0].size)
    for run in runs:
        heights = np.maximum(run.ravel(), 0.0)
        axes.bar(np.arange(heights.size), heights, bottom=bottom, width=1.0)
        bottom += heights
    axes.set_xlim(-0.5, bottom.size - 0.5)
    axes.tick_params(labelsize=7)
