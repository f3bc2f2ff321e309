"""What a pose costs against the number of objects and of primitives: ours, MuJoCo and python-fcl's trees, in one run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from experiments.bench import workload
from experiments.bench.model import BATCH, CALL, MUJOCO, TREES, contestants
from experiments.bench.verdicts import one_core, rates
from experiments.kit.command_line import Progress
from experiments.kit.plots import new_figure

BOXES = (0, 3, 10, 30, 100, 300, 1000)
PRIMITIVES = (8, 16, 32, 64, 96, 129)
AMONG = 100  # boxes, while the number of primitives changes
_NAMES = (BATCH, CALL, MUJOCO, TREES)
_LABELS = {
    BATCH: "ours, in batches",
    CALL: "ours, one call a pose",
    MUJOCO: "MuJoCo, detection only",
    TREES: "python-fcl, trees, yes or no only",
}
_STYLES = {BATCH: ("C0", "-"), CALL: ("C0", "--"), MUJOCO: ("C1", "-"), TREES: ("C2", "-")}


def measure(rounds: int, poses: int = 500) -> dict[str, Any]:
    """Medians in us a pose: {"boxes": {N: {name: us}}, "primitives": {n: {name: us}}}; raises MujocoMissing."""
    points = [("boxes", boxes, 129, boxes) for boxes in BOXES] + [("primitives", count, count, AMONG) for count in PRIMITIVES]
    curves: dict[str, Any] = {"boxes": {}, "primitives": {}}
    with one_core(), Progress() as progress:
        for done, (curve, at, primitives, boxes) in enumerate(points):
            progress.show(done / len(points), f"{at} {curve}")
            everyone = contestants(workload.robot(primitives=primitives), boxes, poses)
            found = rates({name: everyone[name] for name in _NAMES}, rounds)
            curves[curve][at] = {name: float(np.median(1e6 / values)) for name, values in found.items()}
    return curves


def empty_figure() -> Any:
    """A matplotlib Figure to draw into; raises MatplotlibMissing."""
    return new_figure(9.0, 3.8)


def draw(figure: Any, curves: dict[str, Any], path: Path) -> None:
    """Write the figure, two panels."""
    left, right = figure.subplots(1, 2, sharey=True)
    titles = {"boxes": "objects around 129 primitives", "primitives": f"primitives among {AMONG} objects"}
    for axes, (curve, title) in zip((left, right), titles.items(), strict=True):
        found = curves[curve]
        for name in _NAMES:
            color, line = _STYLES[name]
            axes.plot(list(found), [one[name] for one in found.values()], line, color=color, marker=".", label=_LABELS[name])
        axes.set_xlabel(title)
        axes.set_yscale("log")
        axes.grid(alpha=0.3)
    left.set_xscale("symlog", linthresh=3)
    left.set_xlim(-0.5, 1400)
    left.minorticks_off()
    left.set_xticks(BOXES, [str(count) for count in BOXES])
    right.set_xticks(PRIMITIVES, [str(count) for count in PRIMITIVES])
    left.set_ylabel("processor time a pose [us]")
    left.legend(fontsize="small", loc="upper left", bbox_to_anchor=(0.02, 0.88))  # between the curves of the peers
    figure.savefig(path, dpi=150)
