"""Evaluations against dimensions, a panel a function."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from experiments.bench.nes_workload import FUNCTIONS, STRATEGIES
from experiments.kit.cells import CellResult
from experiments.kit.plots import draw_curve, new_figure
from experiments.nes.findings import NAMES, evaluations, tasks
from mobee.errors import InvalidValue


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """Interquartile means and 95 % intervals; a run without success counts with all its evaluations."""
    runs = evaluations(found)
    if not runs:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(12.0, 3.4)
    for axes, function in zip(drawing.subplots(1, len(FUNCTIONS), sharey=True), FUNCTIONS, strict=True):
        for number, name in enumerate(STRATEGIES):
            at = [d for other, d in tasks(runs) if other == function and (name, (function, d)) in runs]
            if at:
                seeds = min(len(runs[name, (function, d)]) for d in at)
                values = np.array([runs[name, (function, d)][:seeds] for d in at]).T
                draw_curve(axes, at, values, f"C{number}", NAMES[name])
        axes.set(title=function, xlabel="dimensions", xscale="log", yscale="log")
        axes.set_xticks([10, 20, 41], ["10", "20", "41"])
        axes.minorticks_off()
        axes.grid(alpha=0.2)
    drawing.axes[0].set_ylabel("evaluations until f < 1e-8")
    drawing.axes[0].legend(fontsize=7)
    drawing.savefig(path, dpi=150)
    return path
