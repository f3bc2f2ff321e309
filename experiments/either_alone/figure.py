"""Success of planner, reach and both in each scene, and what the palm misses."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from experiments.either_alone.cases import SCENES
from experiments.either_alone.findings import success
from experiments.either_alone.trial import WAYS
from experiments.matplotlib_figure import new_figure
from experiments.reaching.arm import GOOD
from experiments.statistics import interquartile_mean, interval
from experiments.sweep import CellResult
from mobee.errors import InvalidValue

COLORS = {"planner": "tab:blue", "reach": "tab:orange", "both": "tab:red"}
LABELS = {"planner": "planner alone", "reach": "reach alone", "both": "both"}
TITLES = {
    "free": "in free space",
    "around": "hand behind\nthe target",
    "against": "hand against\nthe object",
    "between": "obstacle\nbetween",
    "moving": "target moves",
}


def draw(done: Mapping[str, CellResult], path: Path) -> Path:
    """Bars with intervals, and curves of what is missing; raises InvalidValue if there is nothing to draw."""
    if not done:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(14.0, 4.4)
    bars, curves = drawing.subplots(1, 2, width_ratios=(1.5, 1.0))
    for number, way in enumerate(WAYS):
        means, spans = [], []
        for scene in SCENES:
            values = success(done, scene, way)
            means.append(interquartile_mean(values))
            spans.append(interval(values))
        bounds = np.array(spans)
        spread = np.maximum(np.stack([np.array(means) - bounds[:, 0], bounds[:, 1] - np.array(means)]), 0.0)
        at = np.arange(len(SCENES)) + 0.26 * (number - 1)
        bars.bar(at, means, 0.24, yerr=spread, color=COLORS[way], label=LABELS[way], capsize=3)
        missing = np.sort(np.concatenate([one.values[f"{scene}|{way}|missing"] for one in done.values() for scene in SCENES]))
        curves.plot(100.0 * missing, np.arange(1, len(missing) + 1) / len(missing), color=COLORS[way], label=LABELS[way])
    bars.set_xticks(range(len(SCENES)), [TITLES[scene] for scene in SCENES])
    bars.set(ylabel="palm within 2 cm of the surface", ylim=(0.0, 1.02))
    bars.legend(fontsize=9)
    curves.axvline(100.0 * GOOD, color="0.7", linewidth=0.8)
    curves.set(xlabel="from the surface [cm], all scenes", ylabel="share of cases", xlim=(0.0, 25.0), ylim=(0.0, 1.02))
    for axes in (bars, curves):
        axes.grid(alpha=0.2)
    drawing.savefig(path, dpi=110)
    return path
