from __future__ import annotations

import numpy as np
import pytest

from experiments.learning.constraint_actions import constraint_actions, relative_tries, relative_tries_of
from experiments.learning.explored import Explored


def run(tries, failures):
    return Explored(0, np.array(tries), np.array(failures), np.zeros(1, dtype=int), {})


def test_actions_at_constraints_fail_in_more_than_half_of_all_tries():
    chosen = constraint_actions([run([4, 4, 1, 0], [3, 2, 0, 0]), run([2, 4, 1, 0], [0, 2, 1, 0])])
    assert chosen.tolist() == [False, False, False, False]
    assert constraint_actions([run([4, 4], [3, 2])]).tolist() == [True, False]


def test_where_nothing_can_be_compared_there_is_no_ratio():
    assert np.isnan(relative_tries(np.array([3, 5]), np.array([False, False])))
    assert relative_tries(np.array([6, 3]), np.array([True, False])) == 2.0


def test_a_run_is_judged_by_what_fails_in_the_others():
    first, second = run([9, 3], [9, 0]), run([2, 4], [0, 4])
    assert relative_tries_of([first, second], [first, second]) == pytest.approx([3 / 9, 2 / 4])
    assert relative_tries_of([first], [first, run([5, 5], [0, 0])]) == []
