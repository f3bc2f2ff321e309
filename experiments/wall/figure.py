"""Depth and margin against force, and the hand's way to its targets."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.control.colors import COLORS
from experiments.kit.plots import new_figure
from experiments.wall.drawn import DRAWN, Drawn, Way
from experiments.wall.pressing import LEVELS, Pressed
from mobee.errors import InvalidValue


def draw(pressed: Sequence[Pressed], drawn: Sequence[Drawn], path: Path) -> Path:
    """Above the pressing, below the hand that is drawn; raises InvalidValue if there is nothing to draw."""
    if not pressed and not drawn:
        raise InvalidValue(f"{path.parent} has no records of a wall: it was stopped before the first.")
    drawing = new_figure(15.0, 8.0)
    above, below = drawing.subfigures(2, 1, height_ratios=(1.0, 1.1))
    _pressing(above, pressed)
    if drawn:
        _ways(below, drawn, path.parent)
    drawing.savefig(path, dpi=130)
    return path


def _pressing(drawing: Any, pressed: Sequence[Pressed]) -> None:
    panels = drawing.subplots(1, 4)
    shown = (
        ("field_mm", "deepest field [mm]", "table"),
        ("solid_mm", "deepest solid [mm]", ""),
        ("clause_deg", "violation of a constraint [deg]", ""),
        ("limit_deg", "beyond the nearest limit [deg]", "limits"),
    )
    for axes, (what, label, _) in zip(panels, shown, strict=True):
        for gains, color in COLORS.items():
            for wall in dict.fromkeys(p.wall for p in pressed if p.gains == gains):
                mine = [p for p in pressed if p.gains == gains and p.wall == wall]
                values = [getattr(p, what) for p in mine]
                axes.plot([p.force for p in mine], values, ".-", color=color, alpha=0.6, linewidth=0.9)
        axes.set_xscale("symlog", linthresh=LEVELS[1])
        axes.set(xlabel="force before the squash [per unit mass]", ylabel=label)
        axes.grid(alpha=0.2)
    panels[1].set_ylim(-0.2, max(5.0, panels[1].get_ylim()[1]))
    panels[2].axhline(0.0, color="0.3", linewidth=0.8)
    panels[3].axhline(0.0, color="0.3", linewidth=0.8)
    for gains, color in COLORS.items():
        panels[0].plot([], [], color=color, label=f"{gains}, one line a wall")
    panels[0].legend(fontsize=7)


def _ways(drawing: Any, drawn: Sequence[Drawn], folder: Path) -> None:
    names = [name for name in DRAWN if any(d.target == name for d in drawn)]
    columns = (len(names) + 1) // 2
    panels = np.ravel(drawing.subplots(2, columns, squeeze=False))
    for axes, name in zip(panels, names, strict=False):
        for gains, color in COLORS.items():
            for result in (d for d in drawn if d.target == name and d.gains == gains):
                way = Way.load(folder, gains, name)
                label = f"{gains}: at rest ±{result.oscillation_mm:.2f} mm, dead {result.dead_s:.1f} s"
                axes.plot(way.times, np.linalg.norm(way.place - way.target, axis=1), color=color, label=label)
        axes.set_title(f"drawn: {name.replace('-', ' ')}", fontsize=8)
        axes.set(xlabel="time [s]", ylabel="from the target [m]", ylim=(0.0, None))
        axes.legend(fontsize=6)
        axes.grid(alpha=0.2)
    for axes in panels[len(names) :]:
        axes.set_axis_off()
