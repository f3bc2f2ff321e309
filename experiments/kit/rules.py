# SPDX-License-Identifier: Apache-2.0
"""Rows of results and rules of claims, for runs from which numbers are computed and compared between groups.

A group is the runs of one setting.  A rule returns True if the claim holds, False if it fails, and None if the numbers leave it open.
Intervals decide, never the estimates: a claim holds if the whole interval is on its side of a bound, and fails if the whole interval is on
the other side.  Means are interquartile means; intervals are bootstrap intervals.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from experiments.kit.experiment import Holds
from experiments.kit.statistics import (
    LEVEL,
    difference_interval,
    estimate,
    improvement_interval,
    interquartile_mean,
    interval,
    mean_over,
    probability_of_improvement,
    ratio_estimate,
    ratio_interval,
)
from mobee.arrays import Array

Key = TypeVar("Key")
Run = TypeVar("Run")
Decided = tuple[str, bool | None]  # a `Measured` of one setting
ABOUT_EQUAL = (0.9, 1.1)


def row(runs: Sequence[Run], columns: Mapping[str, Callable[[Run], float]]) -> dict[str, Any]:
    """Return a row of results as a dict: "seeds" is the number of runs; every other key is a label, its value an interquartile mean.

    `columns`: for each label, the function that computes one number from a run; the mean is taken over the runs.
    """
    return {"seeds": len(runs)} | {label: mean_over(runs, number) for label, number in columns.items()}


def of_each(groups: Mapping[Key, Iterable[Run]], number: Callable[[Run], float]) -> dict[Key, list[float]]:
    """Return for each group, by its key, the list of the numbers that the function `number` computes from the runs of the group."""
    return {key: [number(run) for run in runs] for key, runs in groups.items()}


def texts(values: Mapping[Any, ArrayLike], digits: int = 2, form: str = "{} {}") -> str:
    """Return the estimates of all groups as text, separated by commas; an estimate is the interquartile mean with its 95 % interval.

    Args:
        values: for each group, by its key, a number from each of its runs.
        digits: decimals of an estimate.
        form: format of each entry; the first {} is the key, with spaces for underscores, the second the estimate.
    """
    return ", ".join(form.format(str(key).replace("_", " "), estimate(group, digits)) for key, group in values.items())


def decides(span: tuple[float, float], least: float = -np.inf, most: float = np.inf) -> bool | None:
    """Return True for an interval `span` (low, high) within [least, most], False for one outside, None for one that contains a bound."""
    low, high = span
    if low >= least and high <= most:
        return True
    return False if high < least or low > most else None


def all_hold(verdicts: Iterable[bool | None]) -> bool | None:
    """Return False if one of the verdicts is False, else None if one is None (open), else True."""
    given = list(verdicts)
    return False if False in given else None if None in given else True


def within(values: ArrayLike, digits: int = 2, least: float = -np.inf, most: float = np.inf, text: str = "{}") -> Decided:
    """Judge from the bootstrap interval whether the interquartile mean of a group lies within [least, most].

    Returns the mean with its 95 % interval as text, and the verdict: True if the whole interval lies within [least, most], False if it lies
    outside, None if it contains a bound.  `values`: one number per run of the group.  `digits`: decimals of the estimate.  `text`: format
    of the text; {} is the estimate.
    """
    return text.format(estimate(values, digits)), decides(interval(values), least, most)


def ratio_within(
    above: ArrayLike, below: ArrayLike, digits: int = 2, least: float = -np.inf, most: float = np.inf, text: str = "{}"
) -> Decided:
    """Judge from the bootstrap interval whether the ratio of the interquartile means of two groups lies within [least, most].

    Returns the ratio with its 95 % interval as text, and the verdict: True if the whole interval lies within [least, most], False if it is
    outside, None if it contains a bound.  `above`: one number per run of the group in the numerator.  `below`: the same for the group in
    the denominator.  `digits`: decimals of the estimate.  `text`: format of the text; {} is the estimate.
    """
    return text.format(ratio_estimate(above, below, digits)), decides(ratio_interval(above, below), least, most)


def about(span: tuple[float, float], least: float, most: float, stronger_below: bool) -> Holds:
    """Judge from the interval `span` (low, high) of an effect whether the effect has the published size, from `least` to `most`.

    Returns True if the whole interval lies within these bounds, and None if it contains a bound.  If it lies outside, the result is
    "stronger" on the side where the effect is larger than published, and False on the other side.  `stronger_below`: the effect is
    larger below `least`; otherwise it is larger above `most`.
    """
    found = decides(span, least, most)
    is_stronger = span[1] < least if stronger_below else span[0] > most
    return "stronger" if found is False and is_stronger else found


def equivalent(first: ArrayLike, second: ArrayLike, margin: float) -> bool | None:
    """Return whether the interquartile means of two groups differ by less than `margin`, by the interval of their difference.

    True if the whole interval lies within [-margin, margin] (two one-sided tests), False if it lies outside, None if it contains a bound.
    `first`, `second`: a number from each run of the two groups.
    """
    return decides(difference_interval(first, second), -margin, margin)


def is_above(first: ArrayLike, second: ArrayLike) -> bool | None:
    """Return whether the interquartile mean of the first group is above that of the second.

    The bootstrap interval of the difference of the means decides: True if the whole interval is above 0, False if no part of it is above 0,
    None if 0 lies inside it.  `first`, `second`: one number per run of each group.
    """
    return _sign(difference_interval(first, second))


def stands_above(values: Mapping[Key, ArrayLike], name: Key, least: float = -np.inf) -> bool | None:
    """Return whether the interquartile mean of the group `name` is above those of all other groups, and above `least`.

    `values`: for each group, by its key, a number from each of its runs.  Returns None if the 95 % intervals do not decide it.
    """
    apart = [is_above(values[name], group) for key, group in values.items() if key != name]
    return all_hold([*apart, *([decides(interval(values[name]), least=least)] if least > -np.inf else [])])


def stands_below(values: Mapping[Key, ArrayLike], name: Key) -> bool | None:
    """Return whether the interquartile mean of the group `name` is below those of all other groups.

    `values`: for each group, by its key, a number from each of its runs.  Returns None if the 95 % intervals do not decide it.
    """
    return all_hold(is_above(group, values[name]) for key, group in values.items() if key != name)


def better(values: Mapping[str, ArrayLike], name: str, rivals: Sequence[str], worse: bool = False, digits: int = 2) -> Decided:
    """Judge whether the numbers of the group `name` are larger than those of every group in `rivals`; returns text and verdict.

    `values`: for each group, by its key, one number per run.  `worse`: judge whether they are smaller instead.  `digits`: decimals in the
    text.  For each rival, the verdict is False if no part of the interval of the probability of improvement is above one half, and True if
    no part is below one half.  Otherwise it is False if both groups are equivalent (the interval of the ratio of their means lies within
    0.9 to 1.1), else None.  The verdicts are combined by `all_hold`.
    """
    parts, verdicts = [f"{name} {estimate(values[name], digits)}"], list[bool | None]()
    for rival in rivals:
        first, second = (values[rival], values[name]) if worse else (values[name], values[rival])
        chance, (low, high) = probability_of_improvement(first, second), improvement_interval(first, second, LEVEL)
        parts.append(f"{rival} {estimate(values[rival], digits)} (P {chance:.2f} [{low:.2f}, {high:.2f}])")
        span = improvement_interval(first, second)
        decided = False if span[1] <= 0.5 else decides(span, least=0.5)  # groups with the same values have the interval [0.5, 0.5]
        verdicts.append(False if decided is None and _about_equal(first, second) else decided)
    return ", ".join(parts), all_hold(verdicts)


def _about_equal(first: ArrayLike, second: ArrayLike) -> bool:
    """Return whether two groups have about the same mean: the interval of the ratio of their interquartile means is within 0.9 to 1.1.

    `first`, `second`: a number from each run of the two groups.  The result is False if a number is not above 0.
    """
    if min(np.min(first), np.min(second)) <= 0.0:
        return False
    return decides(ratio_interval(first, second), *ABOUT_EQUAL) is True


def rises(change: ArrayLike) -> bool | None:
    """Return whether the interquartile mean of `change` is above 0.

    The bootstrap interval of the mean decides: True if the whole interval is above 0, False if no part of it is above 0, None if 0 lies
    inside it.  `change`: one number per run.
    """
    return _sign(interval(change))


def _sign(span: tuple[float, float]) -> bool | None:
    """Return whether an interval (low, high) lies above 0; False if no part of it does, None if a part does."""
    return True if span[0] > 0.0 else False if span[1] <= 0.0 else None


def changes(before: Array, after: Array) -> str:
    """Return as text the interquartile means before and after a change, and the mean of the change with its 95 % interval.

    `before`, `after`: (N,), a number from each of the N runs.
    """
    return f"from {interquartile_mean(before):.2f} to {interquartile_mean(after):.2f}, by {estimate(after - before)}"
