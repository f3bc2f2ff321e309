"""Success against tries, learner and peers, under each kind of error."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.plots import draw_curve, new_figure
from experiments.kit.reaching.planner_peer import MEMORIES
from experiments.kit.statistics import interquartile_mean
from experiments.unmodelled.findings import EQUAL_BY, crossover, success
from experiments.unmodelled.scene import WRONG
from mobee.errors import InvalidValue

COLORS = {"learner": "tab:red", "none": "0.5", "blocked": "tab:blue", "missed": "tab:cyan"}
LABELS = {
    "learner": "reach learner",
    "none": "planner, no memory",
    "blocked": "planner, remembers what was blocked",
    "missed": "planner, also told what missed",
}
TITLES = {
    "nothing": "nothing is hidden",
    "planners": "hidden from the planners",
    "everyone": "hidden from everyone: MoBeE is miscalibrated too",
}


def draw(done: Mapping[str, CellResult], path: Path) -> Path:
    """Three panels; raises InvalidValue if there is nothing to draw."""
    if not done:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(15.0, 4.6)
    for axes, wrong in zip(drawing.subplots(1, len(WRONG), sharey=True), WRONG, strict=True):
        for who, color in COLORS.items():
            tries, values = success(done, who, wrong)
            if len(values):
                draw_curve(axes, tries, values, color, LABELS[who])
        _mark_crossover(axes, done, wrong)
        axes.axvline(EQUAL_BY, color="0.8", linewidth=0.8, zorder=0)
        axes.set(title=TITLES[wrong], xlabel="tries", xscale="log", ylim=(0.0, 1.02))
        axes.set_xticks((5, 25, 50, 100, 200, 400, 800), ("5", "25", "50", "100", "200", "400", "800"))
        axes.minorticks_off()
        axes.grid(alpha=0.2)
    drawing.axes[0].set_ylabel("palm within 2 cm of the target's surface")
    drawing.axes[1].legend(fontsize=8, loc="lower right")  # all four are there
    drawing.savefig(path, dpi=110)
    return path


def _mark_crossover(axes: Any, done: Mapping[str, CellResult], wrong: str) -> None:
    """A star on the learner's curve where, in the median seed, it is below each peer no more."""
    tries, learner = success(done, "learner", wrong)
    for memory in MEMORIES:
        peer = success(done, memory, wrong)[1]
        if not len(learner) or learner.shape != peer.shape:
            continue
        at = float(np.median(crossover(tries, learner, peer)))
        if at in tries:
            height = interquartile_mean(learner[:, tries.index(int(at))])
            axes.plot([at], [height], "*", color=COLORS[memory], markersize=13, zorder=4, markeredgecolor="black", markeredgewidth=0.5)
