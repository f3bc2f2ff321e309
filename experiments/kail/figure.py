"""Both divergences on paper and on the robot."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kail.findings import DIVERGENCES, at_constraints, groups
from experiments.kail.on_paper import KINDS, TRIES, rewards
from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from mobee.errors import InvalidValue

TITLES = {"kail": "'Kail'", "kl": "plain KL, uniform prior"}
SMOOTH = 50  # transitions


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """Rows: divergences; columns: on paper, what transitions pay, tries.  Raises InvalidValue if there is nothing to draw."""
    grouped = groups(found)
    if not grouped:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(14.0, 6.0)
    panels = drawing.subplots(2, 3, squeeze=False)
    for (paper, paid, tried), divergence in zip(panels, DIVERGENCES, strict=True):
        for kind, outcome in KINDS.items():
            paper.plot(np.arange(1, TRIES + 1), rewards("left_arm", divergence, outcome, repeats=100).mean(axis=0), marker=".", label=kind)
        paper.set(title=f"{TITLES[divergence]}: one action of 81 states", xlabel="try", ylabel="reward [nats]", yscale="log")
        for part, label in (("left_arm", "arm, 81 states"), ("torso", "torso, 27 states")):
            if (part, divergence) in grouped:
                paid.plot(_smooth(np.mean([run.values["paid"] for run in grouped[part, divergence]], axis=0)), label=label)
        paid.set(title="what the agents' transitions paid", xlabel="transition", ylabel="reward [nats]", yscale="log")
        if ("left_arm", divergence) in grouped:
            _tries(tried, grouped["left_arm", divergence][0].tries, at_constraints(grouped))
        for axes in (paper, paid, tried):
            axes.legend(fontsize=8)
            axes.grid(alpha=0.2)
    drawing.savefig(path, dpi=150)
    return path


def _smooth(values: np.ndarray) -> np.ndarray:
    return np.convolve(values, np.full(SMOOTH, 1.0 / SMOOTH), mode="valid")


def _tries(axes: Any, tries: np.ndarray, chosen: np.ndarray) -> None:
    number = np.arange(len(tries))
    axes.bar(number[~chosen], tries[~chosen], width=1.0, color="0.6", label="others")
    axes.bar(number[chosen], tries[chosen], width=3.0, color="C3", label="failing")
    axes.set(title=f"tries of the arm in {tries.sum()} transitions", xlabel="state-action")
