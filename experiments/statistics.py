"""Summaries of few runs that say how far they can be trusted (Agarwal et al. 2021, "Deep RL at the edge of the statistical precipice")."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from mobee.errors import InvalidValue
from mobee.robot.robot import Array, Ints

RESAMPLES = 2000
LEVEL = 0.95
Statistic = Callable[[Array], float]


def interquartile_mean(values: ArrayLike) -> float:
    """The mean of what is left when a quarter of the values, rounded down, is cut off at either end; shape (n,), n at least 1."""
    ordered = np.sort(_checked(values))
    cut = len(ordered) // 4
    return float(ordered[cut : len(ordered) - cut].mean())


def interval(
    values: ArrayLike, statistic: Statistic = interquartile_mean, strata: ArrayLike | None = None, seed: int = 0, resamples: int = RESAMPLES
) -> tuple[float, float]:
    """The 95 % interval of a statistic by the stratified bootstrap (percentiles).

    Args:
        values: (n,).
        statistic: of a resample (n,), in which each value comes from the stratum of its place.
        strata: (n,) labels; values are drawn anew within each label.  None: one stratum.
        seed: of the draws.
        resamples: how many.
    """
    given = _checked(values)
    labels = np.zeros(len(given)) if strata is None else np.asarray(strata)
    if labels.shape != given.shape:
        raise InvalidValue(f"strata of shape {labels.shape}: give one label for each of the {len(given)} values.")
    places = [np.flatnonzero(labels == label) for label in np.unique(labels)]
    rng = np.random.default_rng(seed)
    found = [statistic(given[_drawn(places, len(given), rng)]) for _ in range(resamples)]
    low, high = np.quantile(found, [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0])
    return float(low), float(high)


def told(values: ArrayLike, digits: int = 2) -> str:
    """The interquartile mean and its 95 % interval, for people."""
    low, high = interval(values)
    return f"{interquartile_mean(values):.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def _drawn(places: list[Ints], count: int, rng: np.random.Generator) -> Ints:
    chosen = np.empty(count, dtype=np.intp)
    for mine in places:
        chosen[mine] = mine[rng.integers(len(mine), size=len(mine))]
    return chosen


def ratio(above: ArrayLike, below: ArrayLike, statistic: Statistic = interquartile_mean) -> float:
    """The statistic of one group of runs over that of another."""
    return statistic(_checked(above)) / statistic(_checked(below))


def ratio_interval(
    above: ArrayLike, below: ArrayLike, statistic: Statistic = interquartile_mean, seed: int = 0, resamples: int = RESAMPLES
) -> tuple[float, float]:
    """The 95 % bootstrap interval of `ratio`, both groups drawn anew."""
    first, second = _checked(above), _checked(below)
    labels = np.repeat([0, 1], [len(first), len(second)])
    both = np.concatenate([first, second])
    return interval(both, lambda drawn: statistic(drawn[: len(first)]) / statistic(drawn[len(first) :]), labels, seed, resamples)


def decides(span: tuple[float, float], least: float = -np.inf, most: float = np.inf) -> bool | None:
    """Whether an interval (low, high) lies within the bounds, or beside them; None where it holds one of them and so does not decide."""
    low, high = span
    if low >= least and high <= most:
        return True
    return False if high < least or low > most else None


def probability_of_improvement(first: ArrayLike, second: ArrayLike) -> float:
    """How likely a run of the first group is above one of the second, a tie counting half (Mann-Whitney's U / nm)."""
    mine, theirs = _checked(first), _checked(second)
    difference = mine[:, None] - theirs[None, :]
    return float((difference > 0.0).mean() + 0.5 * (difference == 0.0).mean())


def improvement_interval(first: ArrayLike, second: ArrayLike, seed: int = 0, resamples: int = RESAMPLES) -> tuple[float, float]:
    """The 95 % bootstrap interval of `probability_of_improvement`, both groups drawn anew."""
    mine, theirs = _checked(first), _checked(second)
    labels = np.repeat([0, 1], [len(mine), len(theirs)])
    both = np.concatenate([mine, theirs])
    return interval(both, lambda drawn: probability_of_improvement(drawn[: len(mine)], drawn[len(mine) :]), labels, seed, resamples)


def _checked(values: ArrayLike) -> Array:
    given = np.asarray(values, dtype=np.float64)
    if given.ndim != 1 or not len(given) or not np.isfinite(given).all():
        raise InvalidValue(f"values {given.tolist()}: give one or more finite numbers, shape (n,).")
    return given
