"""Rewards of all state-actions as they decay (paper fig. 6)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from experiments.decay.findings import groups
from experiments.matplotlib_figure import new_figure
from experiments.sweep import CellResult
from mobee.errors import InvalidValue


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """One column an explorer, one row a time; the same scale along a row.  Raises InvalidValue if there is nothing to draw."""
    grouped = groups(found)
    if not grouped:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    times = next(iter(grouped.values()))[0]["times"]
    drawing = new_figure(5.0 * len(grouped), 1.7 * len(times))
    panels = drawing.subplots(len(times), len(grouped), squeeze=False, sharex=True, sharey="row")
    for column, (explorer, runs) in enumerate(grouped.items()):
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
    drawing.savefig(path, dpi=150)
    return path
