"""Rules by which measured numbers decide a claim: True, False, or None where the numbers leave it open."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from experiments.kit.claims import Claim
from experiments.kit.statistics import (
    decides,
    estimate,
    improvement_interval,
    interquartile_mean,
    interval,
    probability_of_improvement,
    ratio,
    ratio_interval,
)
from mobee.arrays import Array

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
