"""The curves of graze against the angle of approach."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.graze.trial import Trial
from experiments.kit.plots import new_figure
from mobee.errors import InvalidValue

COLORS = {"off": "0.6", "naive": "tab:red", "mended": "tab:orange", "2.0": "tab:blue"}
LABELS = {"off": "nobody steps in", "naive": "1.0, naive", "mended": "1.0, filter and dead time", "2.0": "2.0"}
DEPTHS = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # mm, marked
SWITCHING = ("naive", "mended")


def draw(trials: Sequence[Trial], path: Path) -> Path:
    """Four panels; raises InvalidValue if there is nothing to draw."""
    if not trials:
        raise InvalidValue(f"{path.parent} has no trial of graze: it was stopped before the first.")
    drawing = new_figure(10.0, 7.0)
    (success, switching), (depth, progress) = drawing.subplots(2, 2, sharex=True)
    _curves(success, trials, SWITCHING, lambda t: 100.0 * t.recovered)
    _curves(success, trials, SWITCHING, lambda t: 100.0 * t.clean, "--")
    _curves(success, trials, ("2.0",), lambda t: 100.0 * t.settled)
    success.set(ylabel="share of trials [%]", ylim=(-3.0, 103.0))
    success.set_title("1.0: the first recovery succeeds (dashed: and is clean); 2.0: settles", fontsize=9)
    _curves(switching, trials, SWITCHING, lambda t: t.switches)
    switching.set(ylabel="switches of control per second", ylim=(0.0, None))
    _curves(depth, trials, tuple(LABELS), lambda t: 1e3 * t.depth)
    depth.set(ylabel="deepest in the table's field [mm]", xlabel="angle of approach [degrees]", yscale="symlog", ylim=(0.0, None))
    depth.set_yticks(DEPTHS, [f"{each:g}" for each in DEPTHS])
    _curves(progress, trials, tuple(LABELS), lambda t: 1e2 * t.progress)
    progress.set(ylabel="how far along the table [cm]", xlabel="angle of approach [degrees]")
    for axes in (success, switching, depth, progress):
        axes.set_xscale("log")
        axes.set_xticks(angles := _angles(trials), [f"{angle:g}" for angle in angles], minor=False)
        axes.minorticks_off()
        axes.grid(alpha=0.2)
    depth.legend(fontsize=8)
    drawing.suptitle("Thesis 4.4: a hand that grazes the table at 20 % speed, its client insisting (mean, standard error)")
    drawing.savefig(path, dpi=150)
    return path


def _angles(trials: Sequence[Trial]) -> list[float]:
    return sorted({trial.angle for trial in trials})


def _curves(axes: Any, trials: Sequence[Trial], variants: Sequence[str], value: Callable[[Trial], float], line: str = "-") -> None:
    """Mean and standard error against the angle."""
    for variant in variants:
        rows = []
        for angle in _angles(trials):
            values = [value(trial) for trial in trials if (trial.variant, trial.angle) == (variant, angle)]
            if values:
                rows.append((angle, float(np.mean(values)), float(np.std(values)) / np.sqrt(len(values))))
        if rows:
            x, mean, error = zip(*rows, strict=True)
            axes.errorbar(x, mean, error, linestyle=line, marker="o", markersize=3, capsize=2, color=COLORS[variant], label=LABELS[variant])
