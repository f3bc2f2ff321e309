"""What several figures draw: interquartile means of runs with their 95 % intervals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from experiments.statistics import interquartile_mean, interval
from mobee.robot.robot import Array


def draw_curve(axes: Any, at: ArrayLike, runs: Array, color: str, label: str) -> None:
    """A line through the means of the runs (N, L) at L places, in a band."""
    means, low, high = _of(list(runs.T))
    axes.plot(at, means, "o-", color=color, label=label, markersize=4)
    axes.fill_between(at, low, high, color=color, alpha=0.15, linewidth=0.0)


def draw_bars(axes: Any, at: ArrayLike, groups: Sequence[Array], width: float, color: str, label: str) -> None:
    """A bar with a whisker for each group of runs."""
    means, low, high = _of(groups)
    spread = np.maximum([means - low, high - means], 0.0)  # an interval need not hold the mean
    axes.bar(at, means, width, yerr=spread, color=color, label=label, capsize=3)


def _of(groups: Sequence[Array]) -> tuple[Array, Array, Array]:
    low, high = np.array([interval(one) for one in groups]).T
    return np.array([interquartile_mean(one) for one in groups]), low, high
