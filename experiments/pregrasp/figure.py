"""Bumps, edges begun and time until success against the density of the map (thesis 4.4)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from experiments.kit.statistics import interquartile_mean, interval
from experiments.pregrasp.findings import groups, numbers
from experiments.pregrasp.trial import MODES
from mobee.errors import InvalidValue

COLORS = {"edge": "tab:red", "around": "tab:blue"}
NAMES = {"edge": "the edge is taken out", "around": "so are those around it"}
LABELS = {"bumps": "bumps until success", "seconds": "robot time until success [s]"}


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """A panel for each number, curves of the modes with their intervals, and how many edges the cup invalidates."""
    grouped = groups(found)
    if not grouped:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    vertices = [runs[0]["vertices"] for runs in grouped.values()]
    drawing = new_figure(12.0, 3.6)
    first, *others = drawing.subplots(1, 3)
    first.plot(vertices, [np.mean([values["invalid"].mean() for values in runs]) for runs in grouped.values()], ".-", color="0.3")
    first.set(ylabel="edges that the cup invalidates", yscale="log")
    for axes, (name, label) in zip(others, LABELS.items(), strict=True):
        for mode in MODES:
            rows = [numbers(runs, mode, name) for runs in grouped.values()]
            axes.plot(vertices, [interquartile_mean(row) for row in rows], ".-", color=COLORS[mode], label=NAMES[mode])
            low, high = np.array([interval(row) for row in rows]).T
            axes.fill_between(vertices, low, high, color=COLORS[mode], alpha=0.15, linewidth=0.0)
        axes.set(ylabel=label, ylim=(0.0, None))
        axes.legend(fontsize=8)
    for axes in (first, *others):
        axes.set(xlabel="vertices of the map", xscale="log")
        axes.set_xticks(vertices, labels=[str(count) for count in vertices])
        axes.minorticks_off()
        axes.grid(alpha=0.2)
    drawing.savefig(path, dpi=110)
    return path
