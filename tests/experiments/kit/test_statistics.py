# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from experiments.kit.rules import (
    about,
    all_hold,
    better,
    decides,
    equivalent,
    is_above,
    ratio_within,
    rises,
    row,
    stands_above,
    stands_below,
    texts,
    within,
)
from experiments.kit.statistics import (
    LEVEL,
    RATES,
    difference_interval,
    error_rate,
    estimate,
    gini,
    interquartile_mean,
    interval,
    mean_over,
    probability_of_improvement,
    ratio,
    ratio_estimate,
    ratio_interval,
    relative_spread,
)
from mobee.errors import InvalidValue

numbers = st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=40)
whole = st.lists(st.integers(0, 6), min_size=1, max_size=15)
mean = partial(np.mean, axis=-1)


@given(numbers)
def test_the_interquartile_mean_is_scipys_trimmed_mean(values):
    assert interquartile_mean(values) == pytest.approx(stats.trim_mean(values, 0.25), abs=1e-9)


def test_the_interquartile_mean_leaves_outliers_out():
    assert interquartile_mean([1e9, 3.0, 5.0, -1e9]) == 4.0


@given(whole, whole)
def test_the_probability_of_improvement_is_mann_whitneys_u_by_the_number_of_pairs(first, second):
    u = stats.mannwhitneyu(first, second, method="asymptotic").statistic if len({*first, *second}) > 1 else len(first) * len(second) / 2
    assert probability_of_improvement(first, second) == pytest.approx(u / (len(first) * len(second)))


def test_the_interval_is_scipys_percentile_bootstrap():
    values = np.random.default_rng(3).gamma(2.0, size=30)
    theirs = stats.bootstrap(
        (values,), interquartile_mean, method="percentile", vectorized=False, n_resamples=20_000, rng=1
    ).confidence_interval
    assert interval(values, resamples=20_000) == pytest.approx(
        (theirs.low, theirs.high), abs=0.02
    )  # 4 standard errors of two bootstraps' ends


def test_the_interval_covers_the_truth_as_often_as_it_says():
    rng = np.random.default_rng(5)
    covered = [low < 2.0 < high for low, high in (interval(rng.normal(2.0, 1.0, 40), mean, seed=i, resamples=300) for i in range(200))]
    assert 0.88 <= np.mean(covered) <= 0.99


def test_strata_keep_the_difference_between_them_out_of_the_interval():
    values, strata = np.repeat([0.0, 100.0], 10), np.repeat(["easy", "hard"], 10)
    assert interval(values, mean, strata) == (50.0, 50.0)
    low, high = interval(values, mean)
    assert high - low > 20.0


def test_the_interval_follows_its_seed():
    values = np.random.default_rng(0).normal(size=12)
    assert interval(values, seed=1) == interval(values, seed=1) != interval(values, seed=2)


def test_a_ratio_has_an_interval_in_which_both_groups_are_drawn():
    rng = np.random.default_rng(1)
    above, below = rng.normal(1600.0, 20.0, 12), rng.normal(3300.0, 150.0, 10)
    low, high = ratio_interval(above, below)
    assert low < ratio(above, below) < high
    theirs = stats.bootstrap((above, below), ratio, method="percentile", vectorized=False, n_resamples=5000, rng=2).confidence_interval
    assert (low, high) == pytest.approx((theirs.low, theirs.high), abs=0.003)


@pytest.mark.parametrize("values", [[], [1.0, np.nan], [[1.0, 2.0]]])
def test_values_without_a_mean_are_refused(values):
    with pytest.raises(InvalidValue, match="finite numbers"):
        interquartile_mean(values)


def test_each_value_needs_a_stratum():
    with pytest.raises(InvalidValue, match="one label for each of the 2 values"):
        interval([1.0, 2.0], strata=["a"])


@pytest.mark.parametrize(
    ("span", "verdict"),
    [
        ((0.4, 0.5), True),
        ((0.45, 0.6), True),
        ((0.3, 0.5), None),
        ((0.5, 0.7), None),
        ((0.3, 0.9), None),
        ((0.1, 0.3), False),
        ((0.7, 0.9), False),
    ],
)
def test_an_interval_decides_where_it_holds_no_bound(span, verdict):
    assert decides(span, 0.4, 0.6) is verdict


def test_one_bound_is_enough_to_decide():
    assert decides((1.1, 1.2), most=1.0) is False and decides((0.8, 1.2), least=1.0) is None and decides((1.0, 1.2), least=1.0) is True


def test_a_mean_is_printed_with_its_interval():
    assert estimate([3.0, 3.0, 3.0]) == "3.00 [3.00, 3.00]"
    assert estimate([321, 320, 320, 320], 0).startswith("320 [320, ")


@given(st.lists(st.integers(0, 50), min_size=2, max_size=30).filter(any))
def test_gini_is_half_the_mean_difference_over_the_mean(counts):
    given_ = np.array(counts, dtype=float)
    pairs = np.abs(given_[:, None] - given_).mean()
    assert gini(counts) == pytest.approx(pairs / (2.0 * given_.mean()), abs=1e-12)


def test_equal_counts_have_no_spread():
    assert gini([4, 4, 4]) == pytest.approx(0.0) and relative_spread([4, 4, 4]) == 0.0


def test_a_ratio_is_printed_with_its_interval():
    assert ratio_estimate([2.0, 2.0], [4.0, 4.0]) == "0.50 [0.50, 0.50]"
    assert mean_over(["a", "bbb"], len) == 2.0


def test_the_intervals_decide_whether_one_is_better():
    many = {"a": np.arange(1.0, 11.0), "b": np.arange(1.0, 11.0) + 0.1, "c": np.arange(10.0) - 20.0}
    text, found = better(many, "a", ("b", "c"))
    assert found is None and "P 1.00" in text
    assert better(many, "c", ("a",), worse=True)[1] is True and better(many, "a", ("c",))[1] is True


@pytest.mark.parametrize(
    ("first", "second", "verdict"),
    [([1.0] * 9, [1.0] * 9, False), ([0.0] * 9, [0.0] * 9, False), ([0.0] * 8 + [2.0], [0.0] * 8 + [1.0], None), ([2.0], [0.0], True)],
)
def test_a_group_is_not_better_than_one_with_the_same_values(first, second, verdict):
    assert better({"a": first, "b": second}, "a", ("b",))[1] is verdict
    assert better({"a": second, "b": first}, "a", ("b",), worse=True)[1] is verdict


@pytest.mark.parametrize(("given", "wanted"), [((True, True), True), ((True, None), None), ((None, False), False)])
def test_all_hold_if_none_is_open_or_fails(given, wanted):
    assert all_hold(given) is wanted


@pytest.mark.parametrize(("change", "expected"), [(0.5, True), (-0.5, False), (0.0, None)])
def test_a_change_rises_where_its_interval_is_above_zero(change, expected):
    assert rises(change + np.array([-0.1, 0.1, -0.08, 0.09, 0.0, 0.01])) is expected


@given(st.lists(st.sampled_from([0.0, 1.0]), min_size=5, max_size=12))
def test_a_count_does_not_rise_if_all_of_its_interval_is_zero_and_equal_groups_are_not_above_each_other(counts):
    assert (rises(counts) is False) == (interval(counts)[1] == 0.0)
    assert rises(np.zeros(len(counts))) is False and is_above(counts, counts) is not True


def test_a_group_stands_out_where_its_difference_from_all_others_is_decided():
    groups = {"low": [1.0, 1.1, 1.2], "middle": [2.0, 2.1, 2.2], "high": [3.0, 3.1, 3.2]}
    assert (
        stands_above(groups, "high") is True
        and stands_above(groups, "middle") is False
        and stands_above(groups, "high", least=4.0) is False
    )
    assert stands_below(groups, "low") is True and stands_below(groups, "middle") is False
    assert stands_above(groups | {"same": groups["high"]}, "high") is None


@given(st.lists(st.floats(-10, 10), min_size=5, max_size=12), st.floats(-12, 12))
def test_a_decision_at_a_smaller_rate_is_no_other_decision(values, bound):
    def at(level):
        return decides(interval(values, level=level, resamples=200), least=bound)

    found = [at(1.0 - rate) for rate in RATES]
    decided = [one for one in found if one is not None]
    assert len(set(decided)) <= 1 and found == decided + [None] * (len(found) - len(decided))
    first, rate = error_rate(lambda: decides(interval(values, resamples=200), least=bound))
    assert first == found[0] and rate == (RATES[len(decided) - 1] if decided else RATES[-1])


def test_the_text_of_an_estimate_is_the_same_at_every_rate():
    said = []
    values = [1.0, 2.0, 3.0, 4.0, 5.0]
    error_rate(lambda: said.append(estimate(values)) or interval(values))
    assert set(said) == {estimate(values)} and interval(values) == interval(values, level=LEVEL)


@given(st.lists(st.floats(0, 10), min_size=5, max_size=12), st.lists(st.floats(0, 10), min_size=5, max_size=12), st.floats(0.1, 3))
def test_equal_by_an_equivalence_test_is_never_different_by_more_than_the_margin(first, second, margin):
    found = equivalent(first, second, margin)
    low, high = difference_interval(first, second)
    assert found is (True if -margin <= low and high <= margin else False if low > margin or high < -margin else None)
    assert equivalent(second, first, margin) in (found, None) or found is None


@pytest.mark.parametrize(("span", "verdict"), [((0.45, 0.55), True), ((0.2, 0.3), "stronger"), ((0.35, 0.45), None), ((0.7, 0.8), False)])
def test_an_effect_beyond_its_published_size_is_stronger_on_one_side_alone(span, verdict):
    assert about(span, 0.4, 0.6, stronger_below=True) == verdict


def test_rules_print_the_estimate_and_judge_its_interval():
    assert within([0.5, 0.5], least=0.4, text="share {}") == ("share 0.50 [0.50, 0.50]", True)
    assert ratio_within([2.0, 2.0], [4.0, 4.0], most=0.4) == ("0.50 [0.50, 0.50]", False)
    assert texts({"least_tried": [1.0, 1.0], 0.5: [2.0]}, 1) == "least tried 1.0 [1.0, 1.0], 0.5 2.0 [2.0, 2.0]"
    assert row(["a", "bbb"], {"letters": len}) == {"seeds": 2, "letters": 2.0}
