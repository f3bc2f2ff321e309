"""Success and planning time of the learned reacher and the planner, and how long both arms take around the table's edge."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.plots import draw_bars, new_figure
from experiments.reach_vs_planners.findings import FEASIBLE, SCENES, TOLD, WHO, of_cases
from mobee.errors import InvalidValue

COLORS = {"learner": "tab:red", "peer": "tab:blue"}
LABELS = {"learner": "learned reacher", "peer": "inverse kinematics and RRT-Connect"}


def draw(done: Mapping[str, CellResult], path: Path) -> Path:
    """Three panels; raises InvalidValue if there is nothing to draw."""
    kinds = {one.cell.settings["scene"] for one in done.values()}
    if kinds != {"cases", "two arms"}:
        raise InvalidValue(f"{path.parent} lacks finished cells: go on with --resume.")
    drawing = new_figure(15.0, 4.2)
    success, thinking, arms = drawing.subplots(1, 3)
    for axes, measure, factor in ((success, "success", 1.0), (thinking, "thinking", 1000.0)):
        for number, who in enumerate(WHO):
            values = [factor * of_cases(done, scene, who, measure) for scene in SCENES]
            draw_bars(axes, np.arange(3) + 0.4 * (number - 0.5), values, 0.38, COLORS[who], LABELS[who])
        axes.set_xticks(range(3), [TOLD[scene].replace(" that", "\nthat").replace(" five", "\nfive") for scene in SCENES], fontsize=8)
        axes.grid(alpha=0.2, axis="y")
    success.set(ylabel="palm within 2 cm of the surface", ylim=(0.0, 1.02))
    success.legend(fontsize=8, loc="lower left")
    thinking.set(ylabel="planning a try [ms]", yscale="log")
    queries = [one for one in done.values() if one.cell.settings["scene"] == "two arms"]
    for measure, color, label in (("seconds", "tab:blue", "a way"), ("smoothing", "tab:cyan", "shortened")):
        each = [one.values[measure][one.values["found"].astype(bool)] for one in queries]
        took = np.sort(np.concatenate(each))
        arms.plot(took, np.arange(1, len(took) + 1) / sum(len(one.values["found"]) for one in queries), color=color, label=label)
    arms.axvline(FEASIBLE, color="0.5", linestyle="--", label="BT-RRT, published: a way")
    arms.set(xscale="log", xlabel="both arms around the table's edge: planning [s]", ylabel="share of queries", ylim=(0.0, 1.02))
    arms.legend(fontsize=8)
    arms.grid(alpha=0.2)
    drawing.savefig(path, dpi=110)
    return path
