"""Outcomes, visits, tries and values of both lattices (thesis figs. 7.8 and 7.9), and a map of the states out of reach."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.outcomes import tries_of
from experiments.kit.plots import new_figure
from experiments.rank4.runs import ACTIONS, LEVELS, Run, runs_of
from mobee.errors import InvalidValue
from mobee.robot.robot import Array

SIDE = 16  # states along an edge of the map


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """A row a lattice.  Raises InvalidValue if there is nothing to draw."""
    runs = runs_of(found)
    if not runs:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(17.0, 5.8 * len(runs))
    grid = drawing.add_gridspec(3 * len(runs), 3, width_ratios=(1.0, 1.0, 1.3))
    for row, (lattice, mine) in enumerate(runs.items()):
        rows = slice(3 * row, 3 * row + 3)
        levels = ", ".join(f"{100 * level:g}" for level in LEVELS[lattice])
        _outcomes(drawing.add_subplot(grid[rows, 0]), mine[0], f"{levels} %: where the actions of one run ended")
        _map(drawing, drawing.add_subplot(grid[rows, 1]), mine, f"visits in {ACTIONS[lattice]} actions, mean of {len(mine)} runs")
        _visits(drawing.add_subplot(grid[3 * row, 2]), mine)
        for place, (name, values) in enumerate(_by_action(mine).items(), start=1):
            _actions(drawing.add_subplot(grid[3 * row + place, 2]), mine, name, values)
    drawing.savefig(path, dpi=150)
    return path


def _outcomes(axes: Any, run: Run, title: str) -> None:
    seen, counts = np.unique(run.seen, axis=0, return_counts=True)
    goals = run.space.goals[seen[:, 0], seen[:, 1]]
    elsewhere = seen[:, 2] != goals
    states, actions = np.nonzero(run.space.goals >= 0)
    axes.plot(run.space.goals[states, actions], states, "s", color="0.8", markersize=1.2, label="intended")
    axes.scatter(
        seen[elsewhere, 2], seen[elsewhere, 0], 1.0 + 0.3 * counts[elsewhere], "C3", linewidths=0, label="elsewhere (area: how often)"
    )
    for state in run.unreached:
        axes.axhline(state, color="0.3", linewidth=0.4)
    axes.set(
        title=title, xlabel="state reached", ylabel="from state (lines: never reached)", xlim=(-2, 257), ylim=(257, -2), aspect="equal"
    )
    axes.legend(loc="lower left", fontsize=7, markerscale=2.0)


def _map(drawing: Any, axes: Any, runs: list[Run], title: str) -> None:
    visits = np.mean([run.visits for run in runs], axis=0).reshape(SIDE, SIDE)
    shown = axes.imshow(np.log10(np.maximum(visits, 0.05)), cmap="viridis", origin="lower")
    for state in range(SIDE * SIDE):
        share = np.mean([state in run.unreached for run in runs])
        if share > 0.0:
            color = "white" if share == 1.0 else "C1"
            axes.text(state % SIDE, state // SIDE, str(state), color=color, fontsize=6, ha="center", va="center")
    for edge in range(4, SIDE, 4):
        axes.axvline(edge - 0.5, color="white", linewidth=0.6)
        axes.axhline(edge - 0.5, color="white", linewidth=0.6)
    axes.set(title=title, xlabel="pitch (4 levels) within roll (4)", ylabel="yaw (4 levels) within elbow (4)", xticks=[], yticks=[])
    drawing.colorbar(shown, ax=axes, shrink=0.5, label="log10 of visits; numbered: never (orange: in some)")


def _visits(axes: Any, runs: list[Run]) -> None:
    visits = np.array([run.visits for run in runs])
    axes.bar(np.arange(visits.shape[1]), visits.mean(axis=0), width=1.0)
    axes.fill_between(np.arange(visits.shape[1]), visits.min(axis=0), visits.max(axis=0), color="k", alpha=0.25, step="mid", linewidth=0)
    axes.set(title="visits (mean, and range over the runs)", xlabel="state", xlim=(-0.5, visits.shape[1] - 0.5))


def _by_action(runs: list[Run]) -> dict[str, Array]:
    """Tries and values of every state-action, (runs, state-actions)."""
    exists = runs[0].space.goals >= 0
    return {
        "tries": np.array([tries_of(run.space, run.seen)[exists] for run in runs]),
        "values": np.array([run.values[exists] for run in runs]),
    }


def _actions(axes: Any, runs: list[Run], name: str, values: Array) -> None:
    numbers = np.arange(values.shape[1])
    axes.fill_between(numbers, values.min(axis=0), values.max(axis=0), color="0.75", step="mid", linewidth=0)
    axes.plot(numbers, values.mean(axis=0), linewidth=0.6)
    axes.set(title=f"{name} (mean, and range over the runs)", xlabel="state-action", xlim=(0, values.shape[1]), ylim=(0, None))
