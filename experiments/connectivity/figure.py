"""Success, length of the way and learning time against the number of neighbours."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from experiments.connectivity.findings import direct, groups, length
from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from experiments.kit.statistics import interquartile_mean, interval
from mobee.errors import InvalidValue


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """Three panels; raises InvalidValue if there is nothing to draw."""
    grouped = groups(found)
    if not grouped:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    budgets = next(iter(grouped.values()))[0]["budgets"]
    drawing = new_figure(13.0, 4.0)
    (left, middle, right) = drawing.subplots(1, 3)
    names = [str(graph) for graph in grouped]
    for budget in budgets:
        _line(left, names, [[100.0 * direct(run, budget) for run in runs] for runs in grouped.values()], f"after {budget} transitions")
    left.set(ylabel="tasks solved as directly as can be [%]", xlabel="neighbours", ylim=(None, 100.5))
    left.legend(fontsize=8)
    _line(middle, names, [[length(run) for run in runs] for runs in grouped.values()], f"after {budgets[-1]} transitions")
    middle.set(ylabel="actions on the way", xlabel="neighbours")
    middle.legend(fontsize=8)
    times = [[run["covered"] for run in runs if run["covered"] is not None] for runs in grouped.values()]
    known = [(name, found) for name, found in zip(names, times, strict=True) if found]
    _line(right, [name for name, _ in known], [found for _, found in known], "until everything was tried once")
    right.set(ylabel="transitions", xlabel="neighbours")
    right.legend(fontsize=8)
    for axes in (left, middle, right):
        axes.grid(alpha=0.2)
        axes.tick_params(axis="x", labelrotation=30)
    drawing.savefig(path, dpi=150)
    return path


def _line(axes: Any, names: list[str], values: list[list[float]], label: str) -> None:
    """Interquartile means with their 95 % intervals."""
    middle = [interquartile_mean(one) for one in values]
    bounds = [interval(one) for one in values]
    errors = [
        [max(m - low, 0.0) for m, (low, _) in zip(middle, bounds, strict=True)],
        [max(high - m, 0.0) for m, (_, high) in zip(middle, bounds, strict=True)],
    ]
    axes.errorbar(names, middle, errors, marker="o", markersize=3, capsize=2, label=label)
