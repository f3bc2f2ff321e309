"""Untried state-actions against transitions (paper fig. 4, thesis fig. 7.5)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.coverage.findings import EARLY, covered, groups
from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from mobee.errors import InvalidValue

COLORS = {
    "curious": "tab:red",
    "least_tried": "tab:blue",
    "random": "0.5",
    "nearest_untried": "tab:green",
    "depleting": "tab:purple",
}
LABELS = {
    "curious": "curious (AC)",
    "least_tried": "least tried (LT)",
    "random": "random (RAND)",
    "nearest_untried": "nearest untried",
    "depleting": "depleting (ours)",
}
LEAST_DETOUR = 1e-3  # drawn
TITLES = {"nearest": "16 nearest neighbours", "equidistant": "equidistant neighbours"}


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """A row a graph: constrained, free, the early phase, and each run's detour; raises InvalidValue if there is nothing to draw."""
    grouped = groups(found)
    if not grouped:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    graphs = [graph for graph in TITLES if any(key[0] == graph for key in grouped)]
    drawing = new_figure(16.0, 3.8 * len(graphs))
    for row, graph in zip(drawing.subplots(len(graphs), 4, squeeze=False), graphs, strict=True):
        for axes, world in zip(row, ("constrained", "free"), strict=False):
            mine = {key[2]: values for key, values in grouped.items() if key[:2] == (graph, world)}
            _untried(axes, mine)
            axes.set_title(f"{TITLES[graph]}, {world}", fontsize=10)
        _states(row[2], {key[2]: values for key, values in grouped.items() if key[:2] == (graph, "constrained")})
        row[2].set_title("states seen early, constrained", fontsize=10)
        _detours(row[3], {key[1:]: values for key, values in grouped.items() if key[0] == graph})
        row[0].legend(fontsize=7)
    drawing.savefig(path, dpi=150)
    return path


def _untried(axes: Any, mine: Mapping[str, list[dict[str, Any]]]) -> None:
    """Median and range over the seeds; the time axis ends a little behind LT, RAND runs out of it."""
    ends = [covered(mine[name]) for name in ("least_tried", "curious") if name in mine]
    last = 1.15 * max((float(end.max()) for end in ends), default=1000.0)
    times = np.linspace(0.0, last, 600)
    for name in [name for name in COLORS if name in mine]:
        left = np.array([one["state_actions"] - np.searchsorted(one["new_actions"], times, side="right") for one in mine[name]])
        axes.plot(times, np.median(left, axis=0), color=COLORS[name], linewidth=1.2, label=LABELS[name])
        axes.fill_between(times, left.min(axis=0), left.max(axis=0), color=COLORS[name], alpha=0.15, linewidth=0.0)
    floor = np.median([one["floor"] for values in mine.values() for one in values])
    axes.axvline(floor, color="k", linestyle=":", linewidth=0.8, label="the postman's walk")
    axes.set(xlabel="transitions", ylabel="state-actions never tried", xlim=(0.0, last), ylim=(0.0, None))
    axes.grid(alpha=0.2)


def _states(axes: Any, mine: Mapping[str, list[dict[str, Any]]]) -> None:
    times = np.arange(0, 2 * EARLY)
    for name in [name for name in COLORS if name in mine]:
        seen = np.array([np.searchsorted(one["new_states"], times, side="right") for one in mine[name]])
        axes.plot(times, seen.mean(axis=0), color=COLORS[name], linewidth=1.2, label=LABELS[name])
    axes.axvline(EARLY, color="k", linestyle=":", linewidth=0.8)
    axes.set(xlabel="transitions", ylabel="states seen, mean", xlim=(0.0, times[-1]), ylim=(0.0, None))
    axes.grid(alpha=0.2)


def _detours(axes: Any, mine: Mapping[tuple[str, str], list[dict[str, Any]]]) -> None:
    """A dot a run: how much longer it took than the shortest walk."""
    names = [name for name in COLORS if any(key[1] == name for key in mine)]
    for shift, (world, marker) in zip((-0.12, 0.12), (("constrained", "o"), ("free", "^")), strict=True):
        for place, name in enumerate(names):
            values = mine.get((world, name), [])
            detours = 100.0 * np.maximum(covered(values) / [one["floor"] for one in values] - 1.0, LEAST_DETOUR)
            label = world if place == 0 else None
            axes.plot(np.full(len(detours), place + shift), detours, marker, color=COLORS[name], markersize=4.0, alpha=0.6, label=label)
    axes.set_yscale("log")
    axes.set_yticks(ticks := (0.1, 1, 10, 100, 1000), [f"{tick:g} %" for tick in ticks])
    axes.set_xticks(range(len(names)), ["\n".join(LABELS[name].rsplit(" ", 1)) for name in names], fontsize=7)
    axes.set_title("longer than the postman's walk", fontsize=10)
    axes.legend(fontsize=7)
    axes.grid(alpha=0.2)
