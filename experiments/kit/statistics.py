"""Summaries of few runs that say how far they can be trusted (Agarwal et al. 2021, "Deep RL at the edge of the statistical precipice")."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from experiments.kit.experiment import Claim
from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue

RESAMPLES = 2000
LEVEL = 0.95
Statistic = Callable[[Array], Array]  # of values along the last axis
Run = TypeVar("Run")


def interquartile_mean(values: ArrayLike) -> float:
    """The mean of what is left when a quarter of the values, rounded down, is cut off at either end; shape (n,), n at least 1."""
    return float(interquartile_means(_checked(values)))


def interquartile_means(values: Array) -> Array:
    """The same along the last axis of (..., n)."""
    ordered = np.sort(values, axis=-1)
    cut = values.shape[-1] // 4
    found: Array = ordered[..., cut : values.shape[-1] - cut].mean(axis=-1)
    return found


def mean_over(runs: Sequence[Run], number: Callable[[Run], float]) -> float:
    """The interquartile mean of a number of each run."""
    return interquartile_mean([number(run) for run in runs])


def interval(
    values: ArrayLike,
    statistic: Statistic = interquartile_means,
    strata: ArrayLike | None = None,
    seed: int = 0,
    resamples: int = RESAMPLES,
) -> tuple[float, float]:
    """The 95 % interval of a statistic by the stratified bootstrap (percentiles).

    Args:
        values: (n,).
        statistic: of resamples (resamples, n) along the last axis; in each, every value comes from the stratum of its place.
        strata: (n,) labels; values are drawn anew within each label.  None: one stratum.
        seed: of the draws.
        resamples: how many.
    """
    given = _checked(values)
    labels = np.zeros(len(given)) if strata is None else np.asarray(strata)
    if labels.shape != given.shape:
        raise InvalidValue(f"strata of shape {labels.shape}: give one label for each of the {len(given)} values.")
    found = statistic(given[_drawn(labels, resamples, seed)])
    low, high = np.quantile(found, [(1.0 - LEVEL) / 2.0, (1.0 + LEVEL) / 2.0])
    return float(low), float(high)


def estimate(values: ArrayLike, digits: int = 2) -> str:
    """The interquartile mean and its 95 % interval, for people."""
    low, high = interval(values)
    return f"{interquartile_mean(values):.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def _drawn(labels: Array, resamples: int, seed: int) -> Ints:
    """Places of values, drawn within each label, (resamples, n)."""
    _, stratum, sizes = np.unique(labels, return_inverse=True, return_counts=True)
    order = np.argsort(stratum, kind="stable")
    first = (np.cumsum(sizes) - sizes)[stratum[order]]
    chosen = np.empty((resamples, len(labels)), dtype=np.intp)
    chosen[:, order] = order[first + np.random.default_rng(seed).integers(sizes[stratum[order]], size=chosen.shape)]
    return chosen


def ratio(above: ArrayLike, below: ArrayLike) -> float:
    """The interquartile mean of one group of runs over that of another."""
    return interquartile_mean(above) / interquartile_mean(below)


def ratio_interval(above: ArrayLike, below: ArrayLike) -> tuple[float, float]:
    """The 95 % bootstrap interval of `ratio`, both groups drawn anew."""
    return _of_both(above, below, lambda first, second: interquartile_means(first) / interquartile_means(second))


def ratio_estimate(above: ArrayLike, below: ArrayLike, digits: int = 2) -> str:
    """`ratio` and its 95 % interval, as `told` has them."""
    low, high = ratio_interval(above, below)
    return f"{ratio(above, below):.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def decides(span: tuple[float, float], least: float = -np.inf, most: float = np.inf) -> bool | None:
    """Whether an interval (low, high) lies within the bounds, or beside them; None where it holds one of them and so does not decide."""
    low, high = span
    if low >= least and high <= most:
        return True
    return False if high < least or low > most else None


def probability_of_improvement(first: ArrayLike, second: ArrayLike) -> float:
    """How likely a run of the first group is above one of the second, a tie counting half (Mann-Whitney's U / nm)."""
    return float(_improvements(_checked(first), _checked(second)))


def improvement_interval(first: ArrayLike, second: ArrayLike) -> tuple[float, float]:
    """The 95 % bootstrap interval of `probability_of_improvement`, both groups drawn anew."""
    return _of_both(first, second, _improvements)


def _improvements(first: Array, second: Array) -> Array:
    """Of groups along the last axes."""
    difference = first[..., :, None] - second[..., None, :]
    found: Array = (difference > 0.0).mean(axis=(-2, -1)) + 0.5 * (difference == 0.0).mean(axis=(-2, -1))
    return found


def _of_both(first: ArrayLike, second: ArrayLike, compare: Callable[[Array, Array], Array]) -> tuple[float, float]:
    """The interval of what compares two groups along the last axes."""
    groups = [_checked(first), _checked(second)]
    sizes = [len(group) for group in groups]
    return interval(np.concatenate(groups), lambda drawn: compare(*np.split(drawn, sizes[:1], axis=-1)), np.repeat([0, 1], sizes))


def relative_spread(counts: ArrayLike) -> float:
    """Standard deviation over mean; 0 when all are equal."""
    given = np.asarray(counts, dtype=np.float64)
    return float(given.std() / given.mean())


def gini(counts: ArrayLike) -> float:
    """The Gini coefficient of numbers of 0 or more: 0 when all are equal, 1 - 1/n when one has everything."""
    ordered = np.sort(np.asarray(counts, dtype=np.float64))
    ranks = np.arange(1, len(ordered) + 1)
    return float(2.0 * (ranks * ordered).sum() / (len(ordered) * ordered.sum()) - (len(ordered) + 1) / len(ordered))


def _checked(values: ArrayLike) -> Array:
    given = np.asarray(values, dtype=np.float64)
    if given.ndim != 1 or not len(given) or not np.isfinite(given).all():
        raise InvalidValue(f"values {given.tolist()}: give one or more finite numbers, shape (n,).")
    return given


ABOUT_EQUAL = (0.9, 1.1)
Verdicts = list[bool | None]


def all_hold(verdicts: Iterable[bool | None]) -> bool | None:
    """Whether all hold; False if one does not, else None if one is open."""
    given = list(verdicts)
    return False if False in given else None if None in given else True


def better(values: Mapping[str, ArrayLike], name: str, rivals: Sequence[str], worse: bool = False, digits: int = 2) -> tuple[str, Verdicts]:
    """Whether runs of one group are likelier above (or, `worse`, below) those of each rival than not: the text, and a verdict a rival.

    It holds where the interval of the probability of improvement is above one half, and does not where it is below, or where the
    ratio of the two is within a tenth of 1 with its interval: they are about equal.
    """
    parts, verdicts = [f"{name} {estimate(values[name], digits)}"], Verdicts()
    for rival in rivals:
        first, second = (values[rival], values[name]) if worse else (values[name], values[rival])
        chance, (low, high) = probability_of_improvement(first, second), improvement_interval(first, second)
        parts.append(f"{rival} {estimate(values[rival], digits)} (P {chance:.2f} [{low:.2f}, {high:.2f}])")
        verdicts.append(True if low > 0.5 else False if high < 0.5 or _about_equal(first, second) else None)
    return ", ".join(parts), verdicts


def _about_equal(first: ArrayLike, second: ArrayLike) -> bool:
    """Whether the interval of the ratio is within a tenth of 1; where values are not above 0 there is no ratio."""
    if min(np.min(first), np.min(second)) <= 0.0:
        return False
    return decides(ratio_interval(first, second), *ABOUT_EQUAL) is True


def rises(change: ArrayLike) -> bool | None:
    """Whether the change of the runs is above 0; False where it is below, None where its interval holds 0."""
    low, high = interval(change)
    return True if low > 0.0 else False if high < 0.0 else None


def changes(before: Array, after: Array) -> str:
    """As text: the means before and after, and the mean change of a run."""
    return f"from {interquartile_mean(before):.2f} to {interquartile_mean(after):.2f}, by {estimate(after - before)}"


def published_ratio(claim: Claim, above: ArrayLike, below: ArrayLike, bounds: tuple[float, float], note: str = "") -> Claim:
    """The claim with the measured ratio of two groups of runs, which is to lie within bounds."""
    low, high = span = ratio_interval(above, below)
    return claim.measured(f"{ratio(above, below):.2f} [{low:.2f}, {high:.2f}]{note}", decides(span, *bounds))
