"""Scores and errors of the models against actions, whoever learns what first."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.plots import draw_curve, new_figure
from experiments.simultaneous.findings import runs_of
from mobee.errors import InvalidValue
from mobee.robot.robot import Array, Ints

COLORS = {"contact": "tab:red", "first-3000": "tab:blue", "first-1000": "tab:cyan", "model": "tab:orange", "target": "0.4"}
LABELS = {
    "contact": "at once, by contact",
    "first-3000": "model first, 3000 transitions",
    "first-1000": "model first, 1000 transitions",
    "model": "at once, all is the model's fault",
    "target": "at once, failures are the target's fault",
}


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """Two panels; raises InvalidValue if there is nothing to draw."""
    runs = runs_of(found)
    if not runs:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(12.0, 4.6)
    scores, errors = drawing.subplots(1, 2)
    for way, mine in runs.items():
        _curve(scores, mine.actions, mine.scores, way)
        _curve(errors, mine.actions, mine.errors, way)
    scores.set(xlabel="actions, the model's included", ylabel="cumulative reward, 27 targets", ylim=(0.0, None))
    errors.set(xlabel="actions", ylabel="mean L1 of the transition model", yscale="log")
    errors.legend(fontsize=8)
    for axes in (scores, errors):
        axes.grid(alpha=0.2)
    drawing.savefig(path, dpi=110)
    return path


def _curve(axes: Any, actions: Ints, values: Array, way: str) -> None:
    """Interquartile mean and interval of the runs, at the looks that all of them have."""
    known = np.isfinite(values).all(axis=0)
    if known.any():
        draw_curve(axes, actions[known], values[:, known], COLORS[way], LABELS[way])
