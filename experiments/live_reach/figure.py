"""How far the palm ended from the target's surface, by contestant, and how long it took."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from experiments.kit.plots import new_figure
from experiments.live_reach.findings import TOLD, WHO, tries_of
from experiments.live_reach.measured import Block
from experiments.live_reach.problems import FRESH, GRID
from experiments.live_reach.settings import GOOD

COLORS = {"learner": "tab:red", "peer": "tab:blue"}
TITLES = {GRID: "of the 27, those that can be reached", FRESH: "fresh random targets"}


def draw(blocks: Sequence[Block], touchable: frozenset[int], path: Path) -> Path:
    """Two panels of distances, one of times."""
    drawing = new_figure(14.0, 4.2)
    *distances, times = drawing.subplots(1, 3)
    for axes, kind in zip(distances, (GRID, FRESH), strict=True):
        for who in WHO:
            off = np.sort([1e3 * tried.off for tried in tries_of(blocks, who, kind, touchable if kind == GRID else None)])
            if len(off):
                axes.step(np.minimum(off, 200.0), np.arange(1, len(off) + 1) / len(off), where="post", color=COLORS[who], label=TOLD[who])
        axes.axvline(1e3 * GOOD, color="0.5", linestyle="--", linewidth=0.8)
        axes.set(title=TITLES[kind], xlabel="palm to surface at the end, in truth [mm]", ylabel="share of tries", ylim=(0.0, 1.02))
        axes.set_xlim(-1.0, 100.0)
        axes.grid(alpha=0.2)
        axes.legend(fontsize=8, loc="lower right")
    for who in WHO:
        took = np.sort([t.seconds for kind in (GRID, FRESH) for t in tries_of(blocks, who, kind) if t.success])
        if len(took):
            times.step(took, np.arange(1, len(took) + 1) / len(took), where="post", color=COLORS[who], label=TOLD[who])
    times.set(title="those that succeeded", xlabel="robot time to the target [s]", ylabel="share", ylim=(0.0, 1.02))
    times.grid(alpha=0.2)
    drawing.savefig(path, dpi=110)
    return path
