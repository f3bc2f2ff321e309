"""The share of targets reached against evaluations, a panel a number of motors."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from experiments.bench.ik_solvers import MOST
from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from experiments.ngik.findings import FEW, NES, OURS, RIVALS, WHOLE
from mobee.errors import InvalidValue

LEAST, TICKS = 100, (100, 300, 1000, 3000, 10_000, MOST)  # evaluations


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """All targets of all seeds."""
    if not found:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(10.5, 3.6)
    for axes, motors in zip(drawing.subplots(1, 2, sharey=True), (WHOLE, FEW), strict=True):
        for number, (name, label) in enumerate({NES: OURS[NES], **RIVALS}.items()):
            settings = {"solver": name, "motors": motors}
            mine = [result.values for result in found.values() if settings.items() <= result.cell.settings.items()]
            if mine:
                reached = np.concatenate([values["reached"] for values in mine])
                needed = np.sort(np.concatenate([values["evaluations"] for values in mine])[reached])
                shares = np.arange(len(needed) + 1) / len(reached)
                axes.stairs(shares, [LEAST, *needed, MOST], baseline=None, color=f"C{number}", label=label, linewidth=1.5)
        axes.set(title=f"{motors} motors", xlabel="evaluations", xscale="log", xlim=(LEAST, MOST), ylim=(0.0, 1.02))
        axes.set_xticks(TICKS, [f"{tick}" for tick in TICKS])
        axes.minorticks_off()
        axes.grid(alpha=0.2)
    drawing.axes[0].set_ylabel("targets reached")
    drawing.legend(*drawing.axes[1].get_legend_handles_labels(), loc="outside right upper", fontsize=7)
    drawing.savefig(path, dpi=150)
    return path
