"""The map before and after, as in thesis figure 4.6, and how fast it was explored."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection

from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from experiments.roadmap_from_scratch.settings import MARKER, SAMPLES, joints, robot
from mobee import Model
from mobee.errors import InvalidValue
from mobee.robot.robot import Array

STYLES = {"feasible": ("tab:blue", 1.6), "failed": ("tab:red", 0.7), "not come to": ("0.75", 0.6)}


def draw(found: Mapping[str, CellResult], live: Mapping[str, Any] | None, path: Path) -> Path:
    """Three panels: the map as it was joined, what was found out of it, edges over time."""
    results = sorted(found.values(), key=lambda result: result.cell.seed)
    if not results:
        raise InvalidValue(f"{path.parent} has no finished map: it was stopped before the first was over.")
    drawing = new_figure(15.0, 4.8)
    before, after, course = drawing.subplots(1, 3)
    values = results[0].values if live is None else live
    places = _places(values["samples"])
    exists = values["goals"] >= 0
    _edges(before, values, exists & (np.arange(len(exists)) < SAMPLES)[:, None] & (values["goals"] < SAMPLES), places, "0.4", 0.8)
    before.set_title(f"{SAMPLES} random poses, nothing verified")
    kinds = {
        "not come to": exists & (values["tried"] == 0),
        "failed": (values["tried"] > 0) & ~values["feasible"],
        "feasible": values["feasible"],
    }
    for kind, which in kinds.items():
        _edges(after, values, which, places, *STYLES[kind], label=f"{kind}: {int(which.sum())}")
    after.set_title("explored " + ("offline" if live is None else "live"))
    after.plot(*places[SAMPLES:].T, "o", color="tab:orange", markersize=3, zorder=3, label="joined by single queries")
    after.legend(fontsize=7, loc="upper left")
    for axes in (before, after):
        axes.plot(*places[:SAMPLES].T, "o", color="black", markersize=4, zorder=3)
        axes.set(xlabel="palm, y [m]", ylabel="palm, z [m]", aspect="equal")
    for result in results:
        minutes = result.values["minutes"]
        course.plot(minutes, np.arange(1, len(minutes) + 1), linewidth=1.0, label=f"seed {result.cell.seed}")
    if live is not None:
        course.plot([60.0 * live["hours"]], [live["edges"]], "k*", markersize=10, label="live (edges known at the end)")
    course.axvline(90.0, color="0.5", linestyle="--", linewidth=0.8)
    course.set(xlabel="robot time [min] (dashed: thesis)", ylabel="motions along edges", xlim=(0.0, None), ylim=(0.0, None))
    course.grid(alpha=0.2)
    course.legend(fontsize=7)
    drawing.savefig(path, dpi=110)
    return path


def _places(samples: Array) -> Array:
    """Where the palm is in each pose, seen from the front, (V, 2) m."""
    whole = np.repeat(robot().home[None], len(samples), axis=0)
    whole[:, [robot().motor_index(joint) for joint in joints()]] = samples
    places: Array = Model(robot()).evaluate(whole).position(MARKER)[:, 1:]
    return places


def _edges(axes: Any, values: Mapping[str, Any], which: Array, places: Array, color: str, width: float, label: str = "") -> None:
    states, actions = np.nonzero(which)
    lines = np.stack([places[states], places[values["goals"][states, actions]]], axis=1)
    axes.add_collection(LineCollection(list(lines), colors=color, linewidths=width, label=label))
    axes.autoscale_view()
