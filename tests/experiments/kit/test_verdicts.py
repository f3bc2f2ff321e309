from __future__ import annotations

import numpy as np
import pytest

from experiments.kit.verdicts import all_hold, better, rises


def test_the_intervals_decide_whether_one_is_better():
    many = {"a": np.arange(1.0, 11.0), "b": np.arange(1.0, 11.0) + 0.1, "c": np.arange(10.0) - 20.0}
    text, found = better(many, "a", ("b", "c"))
    assert found == [None, True] and "P 1.00" in text
    assert better(many, "c", ("a",), worse=True)[1] == [True]


@pytest.mark.parametrize(("given", "wanted"), [((True, True), True), ((True, None), None), ((None, False), False)])
def test_all_hold_if_none_is_open_or_fails(given, wanted):
    assert all_hold(given) is wanted


@pytest.mark.parametrize(("change", "expected"), [(0.5, True), (-0.5, False), (0.0, None)])
def test_a_change_rises_where_its_interval_is_above_zero(change, expected):
    assert rises(change + np.array([-0.1, 0.1, -0.08, 0.09, 0.0, 0.01])) is expected
