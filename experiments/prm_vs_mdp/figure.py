"""Success and time of all rivals under each belief, and how time falls with the number of queries."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.plots import new_figure
from experiments.prm_vs_mdp.belief import BELIEFS
from experiments.prm_vs_mdp.summary import BLOCK, Row, Summary
from mobee.errors import InvalidValue

COLORS = {
    "OMPL, planned once": "tab:gray",
    "OMPL, repairs": "tab:orange",
    "OMPL, remembers": "tab:red",
    "lattice, planned once": "0.75",
    "lattice, repairs": "tab:cyan",
    "lattice, remembers": "tab:blue",
    "MDP, 0 learned": "yellowgreen",
    "MDP, 1000 learned": "limegreen",
    "MDP, 4000 learned": "darkgreen",
    "straight": "black",
}
SHOWN = "both"  # the belief of the curves


def draw(summary: Summary, path: Path) -> Path:
    """Two panels of points with intervals, one of curves; raises InvalidValue if there is nothing to draw."""
    if not summary.rows:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(15.0, 5.0)
    success, seconds, curves = drawing.subplots(1, 3)
    _points(success, summary, "hard", "success where going straight fails")
    _points(seconds, summary, "seconds", "plant time a query [s]")
    _curves(curves, summary)
    handles, labels = success.get_legend_handles_labels()
    drawing.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=8)
    drawing.savefig(path, dpi=130)
    return path


def _points(axes: Any, summary: Summary, name: str, label: str) -> None:
    roadmaps = [rival for rival in COLORS if any(row.rival == rival and row.belief for row in summary.rows)]
    for rival, color in COLORS.items():
        rows = [row for row in summary.rows if row.rival == rival]
        if rival in roadmaps:
            shift = 0.11 * (roadmaps.index(rival) - (len(roadmaps) - 1) / 2)
            at = np.array([BELIEFS.index(row.belief) for row in rows]) + shift
            _bars(axes, at, rows, name, color, rival)
        elif rows:  # it believes nothing: the same everywhere
            number = getattr(rows[0], name)
            axes.axhline(number.mean, color=color, linewidth=1.0, label=f"{rival} ({rows[0].price:.1f} h)" if "MDP" in rival else rival)
            axes.axhspan(number.low, number.high, color=color, alpha=0.12, linewidth=0.0)
    axes.set_xticks(range(len(BELIEFS)), BELIEFS, fontsize=8)
    axes.set(xlabel="what the roadmaps believe", ylabel=label, ylim=(0.0, None))
    axes.grid(alpha=0.2, axis="y")


def _bars(axes: Any, at: Any, rows: list[Row], name: str, color: str, label: str) -> None:
    numbers = [getattr(row, name) for row in rows]
    means = np.array([number.mean for number in numbers])
    spread = np.array([[number.mean - number.low for number in numbers], [number.high - number.mean for number in numbers]])
    axes.errorbar(at, means, np.maximum(spread, 0.0), fmt="o", color=color, markersize=4, capsize=2, linewidth=1.0, label=label)


def _curves(axes: Any, summary: Summary) -> None:
    for rival, color in COLORS.items():
        for row in summary.rows:
            if row.rival == rival and row.belief in ("", SHOWN) and rival != "straight" and "once" not in rival:
                at = BLOCK * (np.arange(len(row.curve)) + 0.5)
                axes.plot(at, row.curve[:, 0], ".-", color=color, linewidth=1.2)
                axes.fill_between(at, row.curve[:, 1], row.curve[:, 2], color=color, alpha=0.1, linewidth=0.0)
    axes.set(xlabel="queries so far", ylabel=f"plant time a query [s], roadmaps believe “{SHOWN}”", ylim=(0.0, None))
    axes.grid(alpha=0.2)
