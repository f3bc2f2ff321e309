"""How far and how deep a shove of so many newtons goes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from experiments.control.colors import COLORS
from experiments.kit.plots import new_figure
from experiments.shove.shoving import DIRECTIONS, FORCES, Shoved
from mobee.errors import InvalidValue

LAW_COLORS = {**COLORS, "off": "0.5"}
SHOWN = (("moved_mm", "the hand moved [mm]"), ("solid_mm", "deepest solid [mm]"), ("away_mm", "the hand stayed away [mm]"))


def draw(found: Sequence[Shoved], path: Path) -> Path:
    """A column a direction; raises InvalidValue if there is nothing to draw."""
    if not found:
        raise InvalidValue(f"{path.parent} has no shoves: it was stopped before the first.")
    directions = [name for name in DIRECTIONS if any(s.direction == name for s in found)]
    drawing = new_figure(3.0 * len(directions), 7.0)
    panels = drawing.subplots(len(SHOWN), len(directions), squeeze=False, sharex=True, sharey="row")
    for row, (what, label) in enumerate(SHOWN):
        for column, direction in enumerate(directions):
            axes = panels[row, column]
            for law, color in LAW_COLORS.items():
                mine = sorted((s for s in found if s.law == law and s.direction == direction), key=lambda s: s.force)
                forces, values = [s.force for s in mine], [getattr(s, what) for s in mine]
                axes.plot(forces, values, ".-", color=color, label=law if law != "off" else "no MoBeE")
            axes.grid(alpha=0.2)
            axes.set_xscale("log")
            axes.minorticks_off()
            axes.set_xticks(FORCES, [f"{force:g}" for force in FORCES], fontsize=8)
            if row == 0:
                axes.set_title(direction.replace("-", " "), fontsize=9)
            if row == len(SHOWN) - 1:
                axes.set_xlabel("force at the hand for 0.4 s [N]")
        panels[row, 0].set_ylabel(label)
    np.ravel(panels)[0].legend(fontsize=7)
    drawing.savefig(path, dpi=130)
    return path
