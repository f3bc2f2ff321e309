"""Interest in the table that is not the graph's: tries beside those at a ghost, cycles of the touch rate, and dependent actions.

A graph of 16 neighbours has favourites of its own, so tries are compared with those of the same agent at a ghost of the table.

Touching is cyclic where the touch rate's autocorrelation has a second peak, at a period, which a ghost's has not: that it is high at
the first lags says only that touching comes in bouts.

With a ghost for a table no part disturbs another, but for hands that meet.  So an action that ends elsewhere at the table than at the
ghost depends on the poses of the other parts (paper 4.4).  The truth of that is taken from the runs of other seeds than the judged one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

from experiments.claims.ch7_learning.table_runs import ARMS, EXPLORERS, Run, Runs, spaces, with_ghosts
from experiments.kit.statistics import interval
from mobee.arrays import Array

TOP = 0.05  # of the actions
BOUT = 2  # lags that slow change and bouts explain
PERIODS = 3  # that a run must hold at least: the longest period is a third of it
DIFFERENT = 0.1  # total variation between the outcomes at the table and at the ghost
LEARNERS = {"torso": ("torso",), "arms": ARMS}  # both arms have one graph


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
    """The autocorrelation of a series without its linear trend, at the lags 0 to `most`, (most + 1,)."""
    steps = np.arange(len(rate))
    rest = rate - np.polyval(np.polyfit(steps, rate, 1), steps)
    products = [float((rest[lag:] * rest[: len(rest) - lag]).sum()) for lag in range(most + 1)]
    return np.array(products) / products[0]


def share_of_top(ratios: Array, chosen: NDArray[np.bool_]) -> float:
    """The share of the actions with the highest ratios, of both arms, that is among the chosen (S, A)."""
    count = max(1, round(TOP * ratios[0].size))
    return float(np.mean([chosen.ravel()[np.argsort(-ratio, axis=None)[:count]].mean() for ratio in ratios]))


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
    """The autocorrelation of each run, and of its ghost, at the second peak of the other runs; two runs at least."""
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


SCORES: dict[str, Callable[[Run, Run, str], Array]] = {
    "tries": lambda run, ghost, part: run.tries[part].astype(float),
    "beside_ghost": log_ratios,
}


@dataclass(frozen=True, eq=False)
class Judged:
    """A learner's actions (parts, actions) in one run, the most interesting first: which of them depend on other parts.

    The two arms of a run are no two runs: its numbers are means over the parts.
    """

    hits: NDArray[np.bool_]

    @property
    def chance(self) -> float:
        """The share that depend on other parts."""
        return float(self.hits.mean())

    @property
    def at_all(self) -> float:
        """Precision, which is recall too, when as many actions are called dependent as are."""
        return float(self.hits[:, : int(self.hits[0].sum())].mean())

    @property
    def precision(self) -> Array:
        """The precision of calling the first k dependent, for every k."""
        found: Array = (np.cumsum(self.hits, axis=1) / np.arange(1, self.hits.shape[1] + 1)).mean(axis=0)
        return found

    @property
    def recall(self) -> Array:
        """The recall of calling the first k dependent, for every k."""
        found: Array = (np.cumsum(self.hits, axis=1) / self.hits.sum(axis=1, keepdims=True)).mean(axis=0)
        return found


def dependent(runs: Runs, parts: Sequence[str], but: int) -> NDArray[np.bool_]:
    """Which actions (S, A) of these parts end differently at the table than at the ghost, by the runs of all seeds but one."""
    shares = []
    for world in ("table", "ghost"):
        counts = np.zeros((*spaces()[parts[0]].goals.shape, len(spaces()[parts[0]])))
        for run in (run for explorer in EXPLORERS for run in runs.get(("tree", explorer, world), []) if run.seed != but):
            for part in parts:
                np.add.at(counts, tuple(run.seen[part].T), 1.0)
        shares.append(counts / np.maximum(counts.sum(axis=-1, keepdims=True), 1.0))
    different: NDArray[np.bool_] = 0.5 * np.abs(shares[0] - shares[1]).sum(axis=-1) > DIFFERENT
    return different


def judged(runs: Runs, explorer: str, learner: str, score: str) -> list[Judged]:
    """Every run of an explorer; none where there is no other seed, or no action depends on other parts in the other seeds' runs."""
    found = []
    for run, ghost in with_ghosts(runs, "tree", explorer):
        truth = dependent(runs, LEARNERS[learner], run.seed)
        if truth.any():
            ranked = (SCORES[score](run, ghost, part) for part in LEARNERS[learner])
            found.append(Judged(np.array([truth.ravel()[np.argsort(-values, axis=None, kind="stable")] for values in ranked])))
    return found
