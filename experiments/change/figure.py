"""Tries, value and model error of the actions that changed, over time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.change.runs import CONDITIONS, EVERY, Run, runs_of
from experiments.change.worlds import CHANGES
from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from mobee.errors import InvalidValue
from mobee.robot.robot import Array

STYLES = dict(zip(CONDITIONS, (("C3", "-"), ("C1", "--"), ("C3", ":"), ("C0", "-"), ("C0", ":")), strict=True))
COLUMNS = ("tries of what changed, over the mean of all", "value of what changed [nats]", "L1 error where it changed")
TITLES = {"object": "a ball enters", "friction": "the elbow's friction doubles"}


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """A row a change.  Raises InvalidValue if there is nothing to draw."""
    runs = runs_of(found)
    changes = [change for change in CHANGES if any(key[0] == change for key in runs)]
    if not changes:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(16.0, 4.0 * len(changes))
    for row, change in zip(drawing.subplots(len(changes), 3, squeeze=False), changes, strict=True):
        for condition, style in STYLES.items():
            if mine := runs.get((change, *condition)):
                _curves(row, mine, style, f"{condition[0].replace('_', ' ')}, forgetting {condition[1]:g}")
        for axes, title in zip(row, COLUMNS, strict=True):
            axes.axvline(EVERY * _looks_before(runs, change), color="k", linewidth=0.6)
            axes.set_title(f"{TITLES[change]}: {title}", fontsize=9)
            axes.set(xlabel="transitions", ylim=(0.0, None))
        row[0].legend(fontsize=7)
    drawing.savefig(path, dpi=150)
    return path


def _looks_before(runs: Mapping[Any, list[Run]], change: str) -> int:
    """When the change came, in looks."""
    return next(mine[0].looks_before for key, mine in runs.items() if key[0] == change)


def _curves(row: Any, runs: list[Run], style: tuple[str, str], label: str) -> None:
    tries = np.mean([_smooth(run.tries) for run in runs], axis=0)
    errors, values = (np.mean([run.series[:, column] for run in runs], axis=0) for column in (0, 2))
    for axes, curve in zip(row, (tries, values, errors), strict=True):
        axes.plot(EVERY * (np.arange(len(curve)) + 1), curve, style[1], color=style[0], label=label, linewidth=1.0)


def _smooth(rate: Array) -> Array:
    """Means over the last four looks."""
    padded = np.concatenate([np.full(3, rate[0]), rate])
    return np.convolve(padded, np.full(4, 0.25), mode="valid")
