"""The picture of the comparison: who touched whom how deep, and what became of the commands."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from experiments.babbling.modes import TITLES
from experiments.babbling.results import DEEPEST, OUTCOMES, share
from experiments.kit.plots import new_figure

COLORS = {"off": "tab:red", "one": "tab:orange", "two": "tab:blue"}
OUTCOME_COLORS = ("tab:green", "tab:olive", "0.7")
PAIRS = 12

_Rows = Mapping[str, Mapping[str, Any]]


def draw(rows: _Rows, path: Path) -> Path:
    """Four panels; rows as `results.summarise` makes them, by mode."""
    drawing = new_figure(11.0, 7.5)
    axes = drawing.subplots(2, 2)
    minutes = ", ".join(f"{TITLES[mode]} {row['minutes']:g} min" for mode, row in rows.items())
    drawing.suptitle(f"Motor babbling at 20 % speed, thesis 4.1.1 ({minutes} of robot time)")
    _by_pair(axes[0, 0], rows)
    _by_depth(axes[0, 1], rows)
    _outcomes(axes[1, 0], rows)
    _smoothness(axes[1, 1], rows)
    drawing.savefig(path, dpi=150)
    return path


def _by_pair(axes: Any, rows: _Rows) -> None:
    total: dict[str, int] = {}
    for row in rows.values():
        for pair, count in row["pairs"].items():
            total[pair] = total.get(pair, 0) + count
    pairs = sorted(total, key=lambda pair: (-total[pair], pair))[:PAIRS]
    _bars(axes.barh, rows, [[row["pairs"].get(pair, 0) for pair in pairs] for row in rows.values()])
    axes.set_yticks(range(len(pairs)), [pair.replace(" ", " - ") for pair in pairs], fontsize=8)
    axes.invert_yaxis()
    axes.set(title="Collisions by pair" if pairs else "No collisions", xlabel="events")
    axes.set_xlim(0.0, max(1.0, axes.get_xlim()[1]))


def _by_depth(axes: Any, rows: _Rows) -> None:
    depths = list(next(iter(rows.values()))["depth_histogram_mm"])
    _bars(axes.bar, rows, [list(row["depth_histogram_mm"].values()) for row in rows.values()])
    axes.set_xticks(range(len(depths)), depths)
    axes.set(title=f"Depth of the collisions (allowed with 2.0: {1e3 * DEEPEST:g} mm)", xlabel="mm", ylabel="events")
    axes.set_ylim(0.0, max(1.0, axes.get_ylim()[1]))
    axes.legend(fontsize=8)


def _outcomes(axes: Any, rows: _Rows) -> None:
    bottom = [0.0] * len(rows)
    for outcome, color in zip(OUTCOMES, OUTCOME_COLORS, strict=True):
        heights = [share(row, outcome) for row in rows.values()]
        axes.bar(range(len(rows)), heights, bottom=bottom, color=color, label=outcome)
        bottom = [below + height for below, height in zip(bottom, heights, strict=True)]
    axes.set_xticks(range(len(rows)), [f"{TITLES[mode]}\n{row['commands']} commands" for mode, row in rows.items()])
    axes.set(ylabel="share", ylim=(0.0, 1.0))
    axes.set_title("What became of the commands", pad=22.0)
    axes.legend(fontsize=8, ncols=len(OUTCOMES), loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False)


def _smoothness(axes: Any, rows: _Rows) -> None:
    axes.bar(range(len(rows)), [row["jerk_over_speed"] for row in rows.values()], color=[COLORS[mode] for mode in rows])
    axes.set_xticks(range(len(rows)), [TITLES[mode] for mode in rows])
    axes.set(title="Roughness: jerk over speed, each rms", ylabel="1/s$^2$")


def _bars(bars: Callable[..., Any], rows: _Rows, heights: list[list[int]]) -> None:
    """A bar a mode at every place; `bars`: bar or barh of some axes."""
    width = 0.8 / len(rows)
    for i, (mode, values) in enumerate(zip(rows, heights, strict=True)):
        shift = (i - (len(rows) - 1) / 2.0) * width
        bars([x + shift for x in range(len(values))], values, width, color=COLORS[mode], label=TITLES[mode])
