"""Tries of the three learners (paper fig. 10, thesis fig. 7.12), and how much of them is interest in the table."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from experiments.table.dependence import LEARNERS, judged
from experiments.table.findings import outcome_numbers
from experiments.table.interest import autocorrelation, by_goal, of_arms
from experiments.table.runs import EXPLORERS, FORWARD_STATES, PARTS, WINDOW, Key, Run, low, runs_of, spaces, with_ghosts
from mobee.errors import InvalidValue
from mobee.robot.robot import Array

LAGS = 30  # windows
NAMES = {"curious": "curious", "least_tried": "least tried", "random": "random"}
COLORS = dict(zip(EXPLORERS, ("C3", "C0", "C2"), strict=True))
STYLES = {"table": "-", "ghost": ":"}


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """Above: tries; below: touch, agreement of the arms, cycles, outcomes, the detector.

    Raises InvalidValue unless the curious agents were both at the table and at the ghost.
    """
    runs = {key[1:]: mine for key, mine in runs_of(found).items() if key[0] == "tree"}
    pairs = with_ghosts(runs_of(found), "tree", "curious")
    if not pairs:
        raise InvalidValue(f"{path.parent} has no curious runs at the table and at the ghost: it was stopped too early.")
    drawing = new_figure(17.0, 13.0)
    grid = drawing.add_gridspec(4, 6)
    for part, place in zip(PARTS, (grid[0, :2], grid[0, 2:], grid[1, 2:]), strict=True):
        _tries(drawing.add_subplot(place), pairs, part)
    _ratio_by_pitch(drawing.add_subplot(grid[1, :2]), runs)
    _touch(drawing.add_subplot(grid[2, :3]), runs)
    _arms(drawing.add_subplot(grid[2, 3:]), pairs)
    _cycles(drawing.add_subplot(grid[3, :2]), runs)
    _outcomes(drawing.add_subplot(grid[3, 2:4]), runs)
    _detector(drawing.add_subplot(grid[3, 4:]), runs_of(found))
    drawing.savefig(path, dpi=150)
    return path


def _tries(axes: Any, pairs: list[tuple[Run, Run]], part: str) -> None:
    """Of every state-action in the order of the states, at the table and at the ghost."""
    table, ghost = (np.mean([pair[which].tries[part].ravel() for pair in pairs], axis=0) for which in (0, 1))
    numbers = np.arange(len(table))
    axes.bar(numbers, table, width=1.0, color="C3", label="table")
    axes.step(numbers, ghost, where="mid", color="k", linewidth=0.5, label="ghost")
    if part == "torso":
        per_state = spaces()[part].goals.shape[1]
        axes.axvspan(FORWARD_STATES.start * per_state, FORWARD_STATES.stop * per_state, color="0.9", zorder=0, label="from leaning forward")
    axes.set(title=f"{part.replace('_', ' ')}: tries of each state-action", xlabel="state-action", xlim=(-0.5, len(table) - 0.5))
    axes.legend(loc="upper left", fontsize=7)


def _ratio_by_pitch(axes: Any, runs: Mapping[tuple[str, str], list[Run]]) -> None:
    for place, ((explorer, world), mine) in enumerate(runs.items()):
        values = [run.torso_forward for run in mine]
        axes.bar(place, np.mean(values), color=COLORS[explorer], alpha=1.0 if world == "table" else 0.4)
        axes.plot([place] * len(values), values, "k.", markersize=4)
    axes.axhline(1.0, color="k", linewidth=0.5)
    axes.set_xticks(range(len(runs)), [f"{NAMES[explorer]}\n{world}" for explorer, world in runs], fontsize=7)
    axes.set_title("torso: tries leaning forward over others, second half")


def _touch(axes: Any, runs: Mapping[tuple[str, str], list[Run]]) -> None:
    for (explorer, world), mine in runs.items():
        rates = np.array([_smooth(run.touch_rate) for run in mine])
        at = WINDOW * (np.arange(rates.shape[1]) + 0.5 * (len(mine[0].touch_rate) - rates.shape[1] + 1))
        axes.plot(at, rates.mean(axis=0), STYLES[world], color=COLORS[explorer], label=f"{NAMES[explorer]}, {world}")
        if world == "table":
            axes.fill_between(at, rates.min(axis=0), rates.max(axis=0), color=COLORS[explorer], alpha=0.15, linewidth=0)
    axes.set(title="arm actions that end within 2 cm of the table (mean and range)", xlabel="transitions of an arm", ylabel="share")
    axes.set_ylim(0.0, None)
    axes.legend(fontsize=7, ncols=3, loc="lower right")


def _smooth(rate: Array) -> Array:
    """Means over a tenth of the run."""
    width = max(1, len(rate) // 10)
    return np.convolve(rate, np.full(width, 1.0 / width), mode="valid")


def _arms(axes: Any, pairs: list[tuple[Run, Run]]) -> None:
    ratios = np.mean([by_goal(of_arms(*pair)) for pair in pairs], axis=0)
    for chosen, color, label in ((~low(), "0.6", "other goals"), (low(), "C3", "goals below the table's top with the torso bent")):
        axes.plot(ratios[0, chosen], ratios[1, chosen], "o", color=color, markersize=4, label=label)
    for state in np.argsort(-ratios.sum(axis=0))[:8]:
        axes.annotate(str(state), ratios[:, state], fontsize=7, xytext=(3, 3), textcoords="offset points")
    axes.set(title="curious: log ratio of tries, table over ghost, by goal state", xlabel="left arm", ylabel="right arm")
    axes.legend(fontsize=7)


def _cycles(axes: Any, runs: Mapping[tuple[str, str], list[Run]]) -> None:
    for world in ("table", "ghost"):
        mine = runs.get(("curious", world), [])
        most = min(LAGS, len(mine[0].touch_rate) - 2)
        curves = np.array([autocorrelation(run.touch_rate, most) for run in mine])
        axes.plot(WINDOW * np.arange(most + 1), curves.mean(axis=0), STYLES[world], color="C3", label=world)
        axes.fill_between(WINDOW * np.arange(most + 1), curves.min(axis=0), curves.max(axis=0), color="C3", alpha=0.12, linewidth=0)
    axes.axhline(0.0, color="k", linewidth=0.5)
    axes.set(title="curious: autocorrelation of the touch rate", xlabel="lag (transitions of an arm)")
    axes.legend(fontsize=7)


def _outcomes(axes: Any, runs: Mapping[tuple[str, str], list[Run]]) -> None:
    for place, ((explorer, world), mine) in enumerate((key, runs[key]) for key in runs if key[1] == "table" or key[0] == "curious"):
        most = max(int(outcome_numbers(run).max()) for run in mine)
        counts = np.mean([np.bincount(outcome_numbers(run), minlength=most + 1) for run in mine], axis=0)[1:]
        at = np.arange(1, most + 1) + 0.2 * (place - 1.5)
        hatch = "//" if world == "ghost" else None
        axes.bar(at, counts, 0.2, color=COLORS[explorer], hatch=hatch, label=f"{NAMES[explorer]}, {world}")
    axes.set(title="in how many states an action ended (all parts)", xlabel="different outcomes", ylabel="actions", yscale="log")
    axes.legend(fontsize=7)


def _detector(axes: Any, runs: dict[Key, list[Run]]) -> None:
    """Of the tries beside the ghost's; a dotted line is chance."""
    for learner, style in zip(LEARNERS, ("-", "--"), strict=True):
        for explorer in EXPLORERS:
            mine = judged(runs, explorer, learner, "beside_ghost")
            if mine:
                recall, precision = (np.mean([getattr(one, name) for one in mine], axis=0) for name in ("recall", "precision"))
                axes.plot(recall, precision, style, color=COLORS[explorer], label=f"{learner}, {NAMES[explorer]}")
                axes.axhline(mine[0].chance, color="k", linestyle=":", linewidth=0.5)
    axes.set(title="interest as detector of actions that depend on other parts", xlabel="recall", ylabel="precision", ylim=(0.0, 1.02))
    if axes.lines:
        axes.legend(fontsize=7)
