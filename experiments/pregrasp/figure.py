"""Success, bumps and time until success against the density of the map (thesis 4.4)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from experiments.matplotlib_figure import new_figure
from experiments.pregrasp.findings import groups, numbers
from experiments.pregrasp.trial import MODES
from experiments.statistics import interquartile_mean, interval
from experiments.sweep import CellResult
from mobee.errors import InvalidValue

COLORS = {"remove": "tab:red", "reweigh": "tab:blue"}
LABELS = {"success": "success", "bumps": "bumps until success", "seconds": "robot time until success [s]"}


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """A panel for each number, curves of the modes with their intervals."""
    grouped = groups(found)
    if not grouped:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(13.0, 4.0)
    for axes, (name, label) in zip(drawing.subplots(1, 3), LABELS.items(), strict=True):
        for mode in MODES:
            points = [(runs[0]["vertices"], numbers(runs, mode, name)) for runs in grouped.values()]
            rows = [(v, interquartile_mean(values), *interval(values)) for v, values in points if len(values)]
            if rows:
                vertices, mean, low, high = np.array(rows).T
                axes.plot(vertices, mean, ".-", color=COLORS[mode], label=mode)
                axes.fill_between(vertices, low, high, color=COLORS[mode], alpha=0.15, linewidth=0.0)
        axes.set(xlabel="vertices of the map", ylabel=label, xscale="log", ylim=(0.0, 1.05 if name == "success" else None))
        axes.grid(alpha=0.2)
        axes.legend(fontsize=8)
    drawing.savefig(path, dpi=110)
    return path
