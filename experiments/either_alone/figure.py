"""What planner, reach and both bring in each scene, under both laws."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from experiments.either_alone.findings import LAWS, MEASURE, measured
from experiments.kit.cells import CellResult
from experiments.kit.plots import draw_bars, new_figure
from experiments.kit.reaching.cases import SCENES, WAYS
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
LABEL_OF = {"success": "palm within 2 cm of the surface", "reward": "reward (eq. 8.4)"}


def draw(done: Mapping[str, CellResult], path: Path) -> Path:
    """Bars with intervals, one panel a law; raises InvalidValue if there is nothing to draw."""
    if {one.cell.settings["law"] for one in done.values()} != set(LAWS):
        raise InvalidValue(f"{path.parent} lacks finished cells: go on with --resume.")
    drawing = new_figure(14.0, 4.4)
    for axes, law in zip(drawing.subplots(1, len(LAWS)), LAWS, strict=True):
        for number, way in enumerate(WAYS):
            values = [measured(done, law, scene, way, MEASURE[law]) for scene in SCENES]
            draw_bars(axes, np.arange(len(SCENES)) + 0.26 * (number - 1), values, 0.24, COLORS[way], LABELS[way])
        axes.set_xticks(range(len(SCENES)), [TITLES[scene] for scene in SCENES])
        axes.set(title=f"{law} law", ylabel=LABEL_OF[MEASURE[law]], ylim=(0.0, None))
        axes.grid(alpha=0.2, axis="y")
    drawing.axes[0].legend(fontsize=9)
    drawing.savefig(path, dpi=110)
    return path
