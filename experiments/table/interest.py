"""Interest in the table that is not the graph's: tries beside those of the same agent at a ghost, and cycles of the touch rate."""

from __future__ import annotations

import numpy as np
from scipy.stats import spearmanr

from experiments.table.runs import ARMS, Run, spaces
from mobee.robot.robot import Array

TOP = 0.05  # of the actions


def log_ratios(run: Run, ghost: Run, part: str) -> Array:
    """How much more often each action of a part was tried at the table than at the ghost: logarithms, (S, A)."""
    ratios: Array = np.log((run.tries[part] + 1.0) / (ghost.tries[part] + 1.0))
    return ratios


def of_arms(run: Run, ghost: Run) -> Array:
    """The log ratios of both arms, (2, S, A)."""
    return np.array([log_ratios(run, ghost, arm) for arm in ARMS])


def by_goal(ratios: Array) -> Array:
    """Means over the actions that aim at one state, (2, S)."""
    goals = spaces()[ARMS[0]].goals
    count = np.bincount(goals.ravel(), minlength=len(goals))
    return np.array([np.bincount(goals.ravel(), weights=ratio.ravel(), minlength=len(goals)) / np.maximum(count, 1) for ratio in ratios])


def agreement(pair: Array) -> float:
    """The rank correlation of the two arms."""
    return float(spearmanr(pair[0].ravel(), pair[1].ravel()).statistic)


def autocorrelation(rate: Array, most: int) -> Array:
    """Of a series without its linear trend, at the lags 0 to `most`, (most + 1,)."""
    steps = np.arange(len(rate))
    rest = rate - np.polyval(np.polyfit(steps, rate, 1), steps)
    products = [float((rest[lag:] * rest[: len(rest) - lag]).sum()) for lag in range(most + 1)]
    return np.array(products) / products[0]


def share_of_top(ratios: Array, chosen: Array) -> float:
    """Which share of the actions with the highest ratios, of both arms, is among the chosen (S, A)."""
    count = max(1, round(TOP * ratios[0].size))
    return float(np.mean([chosen.ravel()[np.argsort(-ratio, axis=None)[:count]].mean() for ratio in ratios]))
