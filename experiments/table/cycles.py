"""Whether touching comes in cycles: whether the touch rate's autocorrelation has a second peak, at a period, which a ghost's has not.

That it is high at the first lags says only that touching comes in bouts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from experiments.kit.statistics import interval
from experiments.table.interest import autocorrelation
from experiments.table.runs import Run
from mobee.robot.robot import Array

BOUT = 2  # lags that slow change and bouts explain
PERIODS = 3  # that a run must hold at least: the longest period is a third of it


def correlations(runs: Sequence[Run]) -> Array:
    """The autocorrelation of each run's touch rate up to the longest period, (runs, lags)."""
    return np.array([autocorrelation(run.touch_rate, len(run.touch_rate) // PERIODS) for run in runs])


def second_peak(curves: Array) -> int:
    """At which lag the mean of autocorrelations (runs, lags) is highest after it has first fallen below 0, or after the bouts."""
    mean = curves.mean(axis=0)
    fallen = np.flatnonzero(mean[BOUT + 1 :] < 0.0)
    first = BOUT + 1 + (int(fallen[0]) if len(fallen) else 0)
    return first + int(np.argmax(mean[first:]))


def at_second_peak(ours: Array, theirs: Array) -> tuple[list[float], list[float]]:
    """What the autocorrelation of each run, and of its ghost, is where the other runs have their second peak; two runs at least."""
    lags = [second_peak(np.delete(ours, run, axis=0)) for run in range(len(ours))]
    here, there = ([float(curve[lag]) for curve, lag in zip(curves, lags, strict=True)] for curves in (ours, theirs))
    return here, there


def is_cyclic(ours: Array, theirs: Array) -> bool | None:
    """Whether there is a second peak: above 0 and above the ghosts' by the intervals over two runs or more.

    False where the runs do not stand out from their ghosts either by their highest values, at whatever lags beyond those of bouts;
    None where they do, but have no peak in common.
    """
    here, there = at_second_peak(ours, theirs)
    if interval(here)[0] > max(0.0, interval(there)[1]):
        return True
    mine, ghosts = (curves[:, BOUT + 1 :].max(axis=1) for curves in (ours, theirs))
    return None if interval(mine)[0] > interval(ghosts)[1] else False
