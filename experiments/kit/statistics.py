# SPDX-License-Identifier: Apache-2.0
"""Means of few runs with their uncertainty.

Interquartile means and stratified bootstrap intervals as in Agarwal et al. 2021, "Deep RL at the edge of the statistical precipice".
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue

RESAMPLES = 2000  # bootstrap samples
LEVEL = 0.95  # of the intervals
Statistic = Callable[[Array], Array]  # of values along the last axis
Run = TypeVar("Run")
Found = TypeVar("Found")
RATES = (0.05, 0.04, 0.03, 0.02, 0.01, 0.005, 0.002, 0.001)
"""Error rates of intervals at which a decision is repeated; smaller ones cannot be resolved by a bootstrap of RESAMPLES (2000) samples."""
MIN_RATE = RATES[-1]


@dataclass
class _Decisions:
    """The state of this module while a decision is computed from intervals; `error_rate` sets it, and the interval functions read it.

    `level`: confidence level of the intervals.  `used`: whether `decision_level` has been called.  `samples`: the statistics of bootstrap
    samples that are computed already, (resamples,) each, by the arguments of `_sampled`.
    """

    level: float = LEVEL
    used: bool = False
    samples: dict[tuple[object, ...], Array] = field(default_factory=dict)


_decisions: ContextVar[_Decisions] = ContextVar("decisions")


@contextmanager
def _deciding_at(level: float, samples: dict[tuple[object, ...], Array]) -> Iterator[_Decisions]:
    made = _Decisions(level, samples=samples)
    token = _decisions.set(made)
    try:
        yield made
    finally:
        _decisions.reset(token)


def decision_level() -> float:
    """Return the confidence level of the intervals that decide claims: LEVEL (0.95), except in the function that `error_rate` calls.

    `error_rate` calls that function repeatedly, with another level each time; inside it, the present level is returned, and `error_rate`
    notices that the function uses intervals.
    """
    made = _decisions.get(_Decisions())
    made.used = True
    return made.level


def level_of_each(looks: int) -> float:
    """Return the confidence level of each interval for a claim that holds as soon as one of several comparisons holds (Bonferroni).

    `looks`: number of comparisons.
    """
    return 1.0 - (1.0 - decision_level()) / looks


def error_rate(decide: Callable[[], Found], key: Callable[[Found], object] = lambda found: found) -> tuple[Found, float | None]:
    """Return the result of `decide` with 95 % intervals, and the smallest error rate in RATES at which the result does not change.

    The error rate of an interval is one minus its confidence level: wider intervals have smaller rates.  The returned rate is the p value
    of the decision, rounded up to one of RATES; if the result needs several intervals, it is the largest of their p values.  It is None if
    `decide` computes no interval.  To find the rate, this function calls `decide` several times; meanwhile the functions of this module
    that compute intervals use another confidence level (`decision_level`).  `key`: results with equal keys count as the same.
    """
    samples: dict[tuple[object, ...], Array] = {}  # intervals of all levels are quantiles of the same samples

    def found_at(rate: float) -> tuple[Found, bool]:
        with _deciding_at(1.0 - rate, samples) as made:
            return decide(), made.used

    first, has_interval = found_at(RATES[0])
    if not has_interval:
        return first, None
    low, high = 0, len(RATES) - 1  # RATES[low] gives the same
    middle = high  # most decisions hold at the smallest rate
    while low < high:
        low, high = (middle, high) if key(found_at(RATES[middle])[0]) == key(first) else (low, middle - 1)
        middle = (low + high + 1) // 2
    return first, RATES[low]


def interquartile_mean(values: ArrayLike) -> float:
    """Return the mean of values (n,) without the lowest and the highest quarter of them, each n // 4 values; n is at least 1."""
    return float(interquartile_means(_checked(values)))


def interquartile_means(values: Array) -> Array:
    """Return the interquartile means of values (..., n) along the last axis, shape (...)."""
    ordered = np.sort(values, axis=-1)
    cut = values.shape[-1] // 4
    found: Array = ordered[..., cut : values.shape[-1] - cut].mean(axis=-1)
    return found


def mean_over(runs: Sequence[Run], number: Callable[[Run], float]) -> float:
    """Return the interquartile mean of the numbers that the function `number` computes from each run."""
    return interquartile_mean([number(run) for run in runs])


def interval(
    values: ArrayLike,
    statistic: Statistic = interquartile_means,
    strata: ArrayLike | None = None,
    seed: int = 0,
    resamples: int = RESAMPLES,
    level: float | None = None,
) -> tuple[float, float]:
    """Return the interval (low, high) of a statistic by the stratified percentile bootstrap.

    Args:
        values: (n,).
        statistic: function of bootstrap samples (resamples, n) that computes a number of each sample, along the last axis.
        strata: (n,) label of each value: entry i of a sample is drawn from the values with the label strata[i]; None: from all values.
        seed: of the bootstrap.
        resamples: number of bootstrap samples.
        level: confidence level, 0 to 1; None: the level of `decision_level`, which is 0.95 outside `error_rate`.
    """
    given = _checked(values)
    labels = np.zeros(len(given)) if strata is None else np.asarray(strata)
    if labels.shape != given.shape:
        raise InvalidValue(f"strata of shape {labels.shape}: give one label for each of the {len(given)} values.")
    return _quantiles(_sampled(given, statistic, labels, seed, resamples, statistic), level)


def _quantiles(found: Array, level: float | None) -> tuple[float, float]:
    share = decision_level() if level is None else level
    low, high = np.quantile(found, [(1.0 - share) / 2.0, (1.0 + share) / 2.0])
    return float(low), float(high)


def _sampled(values: Array, statistic: Statistic, labels: Array, seed: int, resamples: int, name: object) -> Array:
    """Return the statistic of each bootstrap sample of the values (n,), (resamples,).

    Inside `error_rate` the result is kept, because intervals of all levels need the same samples.  `statistic`: function of samples
    (resamples, n).  `labels`: (n,) stratum of each value, as in `interval`.  `name`: identifies the statistic among the kept results.
    """
    samples = _decisions.get(_Decisions()).samples
    _, stratum = np.unique(labels, return_inverse=True)
    strata = stratum.tobytes()
    key = (name, values.tobytes(), strata, seed, resamples)
    if key not in samples:
        samples[key] = statistic(values[_drawn(strata, resamples, seed)])
    return samples[key]


def estimate(values: ArrayLike, digits: int = 2) -> str:
    """Return the interquartile mean of values (n,) and its 95 % interval as text, as "0.50 [0.41, 0.62]"; `digits`: decimals."""
    low, high = interval(values, level=LEVEL)
    return f"{interquartile_mean(values):.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


@lru_cache(maxsize=8)  # groups of one size follow each other
def _drawn(strata: bytes, resamples: int, seed: int) -> Ints:
    """Draw bootstrap samples as indices of values, (resamples, n): entry i is drawn from the values in the same stratum as value i.

    `strata`: bytes of an array (n,) intp, the number of the stratum of each value (bytes can be a key of the cache).
    """
    stratum = np.frombuffer(strata, dtype=np.intp)
    sizes = np.bincount(stratum)
    order = np.argsort(stratum, kind="stable")
    first = (np.cumsum(sizes) - sizes)[stratum[order]]
    chosen = np.empty((resamples, len(stratum)), dtype=np.intp)
    chosen[:, order] = order[first + np.random.default_rng(seed).integers(sizes[stratum[order]], size=chosen.shape)]
    chosen.flags.writeable = False
    return chosen


def ratio(above: ArrayLike, below: ArrayLike) -> float:
    """Return the interquartile mean of the values `above` (n,) divided by that of the values `below` (m,)."""
    return interquartile_mean(above) / interquartile_mean(below)


def ratio_interval(above: ArrayLike, below: ArrayLike, level: float | None = None) -> tuple[float, float]:
    """Return the bootstrap interval (low, high) of `ratio`; both groups are resampled.

    `level`: confidence level, 0 to 1; None: the level of `decision_level`, which is 0.95 outside `error_rate`.  `above`:
    (n,), values of the group in the numerator.  `below`: (m,), values of the group in the denominator.
    """
    return _of_both(above, below, _ratios, level)


def difference_interval(first: ArrayLike, second: ArrayLike, level: float | None = None) -> tuple[float, float]:
    """Return the bootstrap interval (low, high) of the interquartile mean of `first` (n,) minus that of `second` (m,).

    Both groups are resampled.  `level`: confidence level, 0 to 1; None: the level of `decision_level`, which is 0.95 outside `error_rate`.
    """
    return _of_both(first, second, _differences, level)


def _ratios(above: Array, below: Array) -> Array:
    return interquartile_means(above) / interquartile_means(below)


def _differences(first: Array, second: Array) -> Array:
    return interquartile_means(first) - interquartile_means(second)


def ratio_estimate(above: ArrayLike, below: ArrayLike, digits: int = 2) -> str:
    """Return the `ratio` of two groups and its 95 % interval as text, as "1.50 [1.20, 1.90]"; `digits`: decimals.

    `above`: (n,), values of the group in the numerator.  `below`: (m,), values of the group in the denominator.
    """
    low, high = ratio_interval(above, below, LEVEL)
    return f"{ratio(above, below):.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"


def probability_of_improvement(first: ArrayLike, second: ArrayLike) -> float:
    """Return the probability that a value of `first` (n,) is above one of `second` (m,); ties count half.

    It is the Mann-Whitney U statistic divided by n * m.
    """
    return float(_improvements(_checked(first), _checked(second)))


def improvement_interval(first: ArrayLike, second: ArrayLike, level: float | None = None) -> tuple[float, float]:
    """Return the bootstrap interval (low, high) of `probability_of_improvement`; both groups are resampled.

    `level`: confidence level, 0 to 1; None: the level of `decision_level`, which is 0.95 outside `error_rate`.  `first` (n,),
    `second` (m,): the values of the two groups.
    """
    return _of_both(first, second, _improvements, level)


def _improvements(first: Array, second: Array) -> Array:
    """Return the share of pairs (one value of `first`, one of `second`) in which the first value is larger; ties count half.

    `first`: (..., n), `second`: (..., m); the groups are along the last axis, and the axes before it are those of the bootstrap samples.
    Returns shape (...).
    """
    difference = first[..., :, None] - second[..., None, :]
    found: Array = (difference > 0.0).mean(axis=(-2, -1)) + 0.5 * (difference == 0.0).mean(axis=(-2, -1))
    return found


def _of_both(first: ArrayLike, second: ArrayLike, compare: Callable[[Array, Array], Array], level: float | None) -> tuple[float, float]:
    """Return the bootstrap interval (low, high) of a statistic of two groups (n,) and (m,), each of them resampled for itself.

    `compare`: computes the statistic; it gets the bootstrap samples of both groups, (..., n) and (..., m), and returns shape (...).
    `level`: confidence level, 0 to 1; None: the level of `decision_level`.
    """
    groups = [_checked(first), _checked(second)]
    sizes = [len(group) for group in groups]
    labels = np.repeat([0, 1], sizes)

    def statistic(drawn: Array) -> Array:
        return compare(*np.split(drawn, sizes[:1], axis=-1))

    return _quantiles(_sampled(np.concatenate(groups), statistic, labels, 0, RESAMPLES, compare), level)


def chi_squared(share: float, freedom: int) -> float:
    """Return the quantile of the chi-squared distribution with `freedom` degrees of freedom below which the share `share` lies."""
    from scipy.special import gammaincinv

    return float(2.0 * gammaincinv(0.5 * freedom, share))


def share_interval(successes: int, tries: int, level: float | None = None) -> tuple[float, float]:
    """Return the interval (low, high) of a share of successes in independent tries (Wilson 1927).

    `level`: confidence level, 0 to 1; None: the level of `decision_level`, which is 0.95 outside `error_rate`.
    """
    from scipy.stats import binomtest  # a second, and only shares need it

    given = binomtest(successes, tries).proportion_ci(decision_level() if level is None else level, method="wilson")
    return float(given.low), float(given.high)


def relative_spread(counts: ArrayLike) -> float:
    """Return the standard deviation of the numbers `counts` divided by their mean; 0 if all numbers are equal."""
    given = np.asarray(counts, dtype=np.float64)
    return float(given.std() / given.mean())


def gini(counts: ArrayLike) -> float:
    """Return the Gini coefficient of `counts`, n numbers >= 0: 0 if all are equal, 1 - 1/n if all but one are 0."""
    ordered = np.sort(np.asarray(counts, dtype=np.float64))
    ranks = np.arange(1, len(ordered) + 1)
    return float(2.0 * (ranks * ordered).sum() / (len(ordered) * ordered.sum()) - (len(ordered) + 1) / len(ordered))


def _checked(values: ArrayLike) -> Array:
    given = np.asarray(values, dtype=np.float64)
    if given.ndim != 1 or not len(given) or not np.isfinite(given).all():
        raise InvalidValue(f"values {given.tolist()}: give one or more finite numbers, shape (n,).")
    return given
