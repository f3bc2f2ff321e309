from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.learning.spread import gini, relative_spread


@given(st.lists(st.integers(0, 50), min_size=2, max_size=30).filter(any))
def test_gini_is_half_the_mean_difference_over_the_mean(counts):
    given_ = np.array(counts, dtype=float)
    pairs = np.abs(given_[:, None] - given_).mean()
    assert gini(counts) == pytest.approx(pairs / (2.0 * given_.mean()), abs=1e-12)


def test_equal_counts_have_no_spread():
    assert gini([4, 4, 4]) == pytest.approx(0.0) and relative_spread([4, 4, 4]) == 0.0
