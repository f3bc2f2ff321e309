"""The figures of thesis 8.4 in one picture."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.plots import new_figure
from experiments.kit.statistics import interquartile_mean, interval
from experiments.reach.poses import draw_poses
from experiments.reach.runs import Runs, runs_of
from mobee.errors import InvalidValue

COLORS = {"intrinsic": "tab:red", "greedy": "tab:blue", "random": "0.4"}
TITLES = {"intrinsic": "intrinsic motivation", "greedy": "greedy, optimistic", "random": "random"}
STACKED = 5  # runs whose choices are drawn on top of each other, as published
SHOWN = (0.0, 0.5, 1.0)  # which looks, as shares of their number


def draw(found: Mapping[str, CellResult], path: Path) -> Path:
    """Scores and costs above; a row a strategy with its choices and its problem-tries; the favourite poses below."""
    runs = runs_of(found)
    if not runs:
        raise InvalidValue(f"{path.parent} has no finished cells: it was stopped before the first.")
    drawing = new_figure(15.0, 5.0 + 2.6 * len(runs) + 3.9)
    drawing.get_layout_engine().set(w_pad=0.1)  # inches: labels do not touch the panel before
    above, middle, below = drawing.subfigures(3, 1, height_ratios=[5.0, 2.6 * len(runs), 3.9])
    scores, costs, fails = above.subplots(1, 3, width_ratios=[2.0, 1.0, 2.0])
    _scores(scores, runs)
    _costs(costs, runs)
    _failures(fails, runs)
    for row, (name, mine) in zip(middle.subplots(len(runs), 5, squeeze=False), runs.items(), strict=True):
        looks = [mine.looks[round(share * (len(mine.looks) - 1))] for share in SHOWN]
        for axes, look in zip(row[:3], looks, strict=True):
            _choices(axes, mine, look, f"{TITLES[name]}, {look}")
        for axes, look in zip(row[3:], looks[1:], strict=True):
            _tries(axes, mine, look, f"{TITLES[name]}, {look}")
    draw_poses(below, runs[next(iter(runs))])
    drawing.savefig(path, dpi=130)
    return path


def _scores(axes: Any, runs: Mapping[str, Runs]) -> None:
    """Interquartile mean and interval over the runs, and each run as a dot (fig. 8.2)."""
    for shift, (name, mine) in zip((0.97, 1.0, 1.03), runs.items(), strict=False):
        scores = np.array([mine.scores(look) for look in mine.looks])
        at = shift * np.array(mine.looks)
        middle, spans = [interquartile_mean(one) for one in scores], np.array([interval(one) for one in scores]).T
        axes.plot(at, middle, color=COLORS[name], label=f"{TITLES[name]} ({len(mine)})")
        axes.fill_between(at, *spans, color=COLORS[name], alpha=0.15, linewidth=0.0)
        axes.plot(at, scores, ".", color=COLORS[name], markersize=3.0, alpha=0.4)
    axes.set(xscale="log", xlabel="problem-tries", ylabel="cumulative reward, 27 targets", ylim=(0.0, None), title="fig. 8.2: competence")
    looks = next(iter(runs.values())).looks
    axes.set_xticks(looks, looks)
    axes.minorticks_off()
    axes.legend(fontsize=8)
    axes.grid(alpha=0.2)


def _costs(axes: Any, runs: Mapping[str, Runs]) -> None:
    hours = [5.0 * float(mine.hours().mean()) for mine in runs.values()]
    axes.bar(range(len(runs)), hours, color=[COLORS[name] for name in runs])
    axes.set_xticks(range(len(runs)), runs, fontsize=8)
    axes.set(ylabel="h of the robot, 5 runs", title="exploration takes")


def _failures(axes: Any, runs: Mapping[str, Runs]) -> None:
    """Negative rewards by state-action, sorted: where each strategy's runs fail (fig. 8.8)."""
    most = 0.0
    for name, mine in runs.items():
        mean = np.mean([one["failures"] for one in mine.values], axis=0).sum(axis=1)
        most = max(most, float(mean.max()))
        axes.step(range(len(mean)), mean, color=COLORS[name], where="mid", label=f"{TITLES[name]}: {mean.sum():.0f} a run", linewidth=1.0)
    axes.set(xlabel="state in which the transition begins", ylabel="negative rewards, mean of the runs", title="fig. 8.8")
    axes.set_yscale("symlog", linthresh=1.0)
    axes.set(ylim=(0.0, 4.0 * most + 1.0))
    ticks = [0, *(each for each in (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500) if each < 2.0 * most)]
    axes.set_yticks(ticks, [f"{each:g}" for each in ticks])
    axes.minorticks_off()
    axes.legend(fontsize=8, loc="upper center")


def _choices(axes: Any, mine: Runs, look: int, title: str) -> None:
    """From where the first runs reached when evaluated, stacked (figs. 8.4 to 8.6)."""
    chosen = mine.chosen(look)[:STACKED]
    floor = np.zeros(chosen.shape[1])
    for number, one in enumerate(chosen):
        axes.stairs(floor + one, np.arange(len(one) + 1) - 0.5, baseline=floor, fill=True, color=f"C{number}")
        floor = floor + one
    axes.set_title(title, fontsize=9)
    axes.set_xlabel("state reached from", fontsize=8)


def _tries(axes: Any, mine: Runs, look: int, title: str) -> None:
    """How often each state was reached from for each target (fig. 8.7)."""
    axes.imshow(np.log1p(mine.exploration(look)), aspect="auto", cmap="viridis", interpolation="nearest")
    axes.set_title(f"tries: {title}", fontsize=9)
    axes.set_xlabel("state", fontsize=8)
    axes.set_ylabel("target", fontsize=8)
