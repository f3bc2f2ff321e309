from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.learning.counted import exists_in, failures_of, tries_of, visits_of
from experiments.learning.published import HYPERCUBE, arm_space
from experiments.learning.spread import gini, relative_spread


def test_tries_failures_and_visits_are_those_of_the_record():
    space = arm_space(HYPERCUBE)
    goal = int(space.goals[3, 1])
    seen = np.array([[3, 1, goal], [3, 1, 3], [3, 0, 3]], dtype=np.uint16)
    assert tries_of(space, seen)[3].tolist() == [1, 2, 0, 0]
    assert failures_of(space, seen)[3].tolist() == [1, 1, 0, 0]
    assert visits_of(space, seen)[[3, goal]].tolist() == [2, 1]
    assert exists_in(space).sum() == space.state_actions


@given(st.lists(st.integers(0, 50), min_size=2, max_size=30).filter(any))
def test_gini_is_half_the_mean_difference_over_the_mean(counts):
    given_ = np.array(counts, dtype=float)
    pairs = np.abs(given_[:, None] - given_).mean()
    assert gini(counts) == pytest.approx(pairs / (2.0 * given_.mean()), abs=1e-12)


def test_equal_counts_have_no_spread():
    assert gini([4, 4, 4]) == pytest.approx(0.0) and relative_spread([4, 4, 4]) == 0.0
