"""Visits and tries of one run an explorer (paper fig. 5)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from experiments.uniformity.findings import EXPLORERS, at_constraints, groups
from mobee.errors import InvalidValue

TITLES = {"curious": "curious (AC)", "least_tried": "least tried (LT)", "random": "random (RAND)"}


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """Rows: explorers; columns: visits of states, tries of state-actions.  Raises InvalidValue if there is nothing to draw."""
    grouped = groups(found)
    shown = [explorer for explorer in EXPLORERS if ("nearest", explorer) in grouped]
    if not shown:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(13.0, 2.4 * len(shown))
    panels = drawing.subplots(len(shown), 2, squeeze=False, sharex="col", sharey="col", width_ratios=(1, 3))
    chosen = at_constraints(grouped, "nearest")
    for (left, right), explorer in zip(panels, shown, strict=True):
        run = grouped["nearest", explorer][0]
        left.bar(np.arange(len(run.visits)), run.visits, width=1.0, color="0.4")
        left.set_ylabel(TITLES[explorer])
        number = np.arange(len(run.tries))
        right.bar(number[~chosen], run.tries[~chosen], width=1.0, color="0.6", label="others")
        right.bar(number[chosen], run.tries[chosen], width=2.5, color="C3", label="at constraints")
        right.set_xlim(-1, len(number))
    panels[0][0].set_title(f"visits of states in {run.tries.sum()} transitions", fontsize=9)
    panels[0][1].set_title("tries of state-actions (16 nearest neighbours)", fontsize=9)
    panels[0][1].legend(fontsize=8, loc="upper right")
    panels[-1][0].set_xlabel("state")
    panels[-1][1].set_xlabel("state-action")
    drawing.savefig(path, dpi=150)
    return path
