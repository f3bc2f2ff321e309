# SPDX-License-Identifier: Apache-2.0
"""Plots with Matplotlib, which is optional: experiments run without it, only their figures need it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from experiments.kit.statistics import interquartile_mean, interval
from mobee.arrays import Array
from mobee.errors import InvalidValue, MobeeError


class MatplotlibMissing(MobeeError):
    """Raised if a figure is requested and the package Matplotlib is not installed."""


def new_figure(width: float, height: float) -> Any:
    """Return an empty Matplotlib Figure of this width and height in inches.

    Raises MatplotlibMissing.  Raises InvalidValue if the width or height is not above 0: a caller that computes the size from the number of
    finished runs gets 0 if no run is finished.
    """
    if not (width > 0.0 and height > 0.0):
        raise InvalidValue("none of the runs that the figure shows is finished: continue the run with --resume.")
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MatplotlibMissing('figures need Matplotlib, which is not installed: pip install "mobee[figures]"') from None
    return Figure(figsize=(width, height), layout="constrained")


def saved(drawing: Any, folder: Path, dpi: int = 150) -> Path:
    """Save the Matplotlib Figure `drawing` as figure.png in the folder of a run, with `dpi` pixels per inch; returns the path."""
    path = folder / "figure.png"
    drawing.savefig(path, dpi=dpi)
    return path


def finish(axes: Any, legend: float = 0.0, **settings: Any) -> None:
    """Set labels, limits and scales by `axes.set(**settings)`, and draw a faint grid, and a legend of font size `legend` (0: none)."""
    axes.set(**settings)
    axes.grid(alpha=0.2)
    if legend:
        axes.legend(fontsize=legend)


def finish_normalised(axes: Any) -> None:
    """Complete a plot of cumulative distributions of normalised squared errors in 3-D: add a reference curve, axis labels and a legend.

    The curve is the chi-squared distribution with 3 degrees of freedom, which the errors have if their covariance is correct.  `axes`: of
    Matplotlib.
    """
    from scipy.special import chdtr

    grid = np.linspace(0.0, 12.0, 300)
    axes.plot(grid, chdtr(3, grid), color="black", linestyle="--", linewidth=1.0, label="chi-squared, 3 degrees of freedom")
    finish(axes, xlabel="normalised squared error", ylabel="share of the places", xlim=(0.0, 12.0))
    axes.legend(fontsize=7, loc="lower right")


def ticks_at(axes: Any, places: Sequence[float], labels: Sequence[str] | None = None) -> None:
    """Mark only the values `places` on the x axis, with `labels`; None: with the numbers themselves.

    `axes`: of Matplotlib.
    """
    axes.set_xticks(places, [f"{place:g}" for place in places] if labels is None else labels)
    axes.minorticks_off()


def draw_curve(axes: Any, at: ArrayLike, runs: Array, color: str, label: str) -> None:
    """Draw the interquartile means of N runs at L places of the x axis as a line, and their 95 % bootstrap intervals as a band.

    `at`: (L,) x values.  `runs`: (N, L), a row for each run.  `axes`: of Matplotlib.  `color`: of line and band.  `label`: of the line in
    the legend.
    """
    draw_band(axes, at, list(runs.T), "o-", color=color, label=label, markersize=4)


def draw_band(axes: Any, at: ArrayLike, groups: Sequence[ArrayLike], line: str, color: str, alpha: float = 0.15, **style: Any) -> None:
    """Draw the interquartile mean of each group of runs as a line, and the 95 % bootstrap intervals as a band.

    `at`: x value of each group.  `groups`: for each group, a number from each of its runs.  `line`: Matplotlib's format of the line, as
    "o-".  `alpha`: opacity of the band.  `style`: passed to `axes.plot`.
    """
    means, low, high = _of(groups)
    axes.plot(at, means, line, color=color, **style)
    axes.fill_between(at, low, high, color=color, alpha=alpha, linewidth=0.0)


def draw_bars(axes: Any, at: ArrayLike, groups: Sequence[Array], width: float, color: str, label: str) -> None:
    """Draw the interquartile mean of each group of runs as a bar, and its 95 % bootstrap interval as a whisker.

    `at`: x value of each group.  `groups`: for each group, a number from each of its runs.  `width`: width of a bar, in units of the x
    axis.  `axes`: of Matplotlib.  `color`: of the bars.  `label`: of the bars in the legend.
    """
    means, low, high = _of(groups)
    spread = np.maximum([means - low, high - means], 0.0)  # an interval need not hold the mean
    axes.bar(at, means, width, yerr=spread, color=color, label=label, capsize=3)


def draw_points(axes: Any, at: ArrayLike | Sequence[str], groups: Sequence[ArrayLike], **style: Any) -> None:
    """Draw the interquartile mean of each group of runs as a point, and its 95 % bootstrap interval as a whisker.

    `at`: x value or label of each group.  `groups`: for each group, a number from each of its runs.  `style`: passed to `axes.errorbar`.
    """
    means, low, high = _of(groups)
    spread = np.maximum([means - low, high - means], 0.0)  # an interval need not hold the mean
    axes.errorbar(at, means, spread, **style)


def draw_heights(axes: Any, values: ArrayLike, **style: Any) -> None:
    """Draw many numbers (`values`) as adjacent bars at x = 0, 1, ... in one patch, because thousands of separate rectangles take seconds.

    `style`: passed to `axes.stairs`.  `axes`: of Matplotlib.
    """
    axes.stairs(values, np.arange(np.size(values) + 1) - 0.5, fill=True, **style)


def draw_stacked_bars(axes: Any, runs: Sequence[Array]) -> Array:
    """Draw L bars at x = 0, 1, ..., each stacked from one value of every run, with a colour for each run; returns their heights (L,).

    `runs`: for each run, its L values, one for each bar.  The first run is at the bottom.  `axes`: of Matplotlib.
    """
    heights = np.zeros(len(runs[0]))
    for run in runs:
        draw_heights(axes, heights + run, baseline=heights)
        heights = heights + run
    axes.set_xlim(-0.5, len(heights) - 0.5)
    axes.tick_params(labelsize=7)
    return heights


def _of(groups: Sequence[ArrayLike]) -> tuple[Array, Array, Array]:
    low, high = np.array([interval(one) for one in groups]).T
    return np.array([interquartile_mean(one) for one in groups]), low, high
