from __future__ import annotations

import numpy as np
import pytest

from experiments.table.dependence import Judged
from experiments.table.interest import agreement, autocorrelation


def test_a_trend_is_no_correlation_but_periods_are():
    steps = np.arange(100)
    periods = (steps // 10) % 2
    found = autocorrelation(periods + 0.01 * steps, 10)
    assert found[0] == pytest.approx(1.0)
    assert found[1] > 0.7
    assert found[10] < -0.7
    assert autocorrelation(steps % 2, 1)[1] < -0.9


def test_arms_that_prefer_the_same_agree():
    tries = np.random.default_rng(0).normal(size=(3, 4))
    assert agreement(np.array([tries, 2.0 * tries + 1.0])) == pytest.approx(1.0)
    assert agreement(np.array([tries, -tries])) == pytest.approx(-1.0)


def test_precision_and_recall_of_a_ranking():
    judged = Judged(np.array([[True, False, True, False]]))
    assert judged.precision.tolist() == pytest.approx([1.0, 0.5, 2 / 3, 0.5])
    assert judged.recall.tolist() == pytest.approx([0.5, 0.5, 1.0, 1.0])
    assert (judged.at_all, judged.chance) == (0.5, 0.5)


def test_both_arms_of_a_run_are_one_value():
    judged = Judged(np.array([[True, True, False, False], [False, True, False, True]]))
    assert (judged.at_all, judged.chance) == (0.75, 0.5)
    assert judged.precision.tolist() == pytest.approx([0.5, 0.75, 0.5, 0.5])
    assert judged.recall.tolist() == pytest.approx([0.25, 0.75, 0.75, 1.0])
