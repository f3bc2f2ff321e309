from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.errors import InvalidValue
from mobee.learning.transitions import information_gain, kl_divergence

PRINTED = 5e-5


@pytest.mark.parametrize(
    ("p", "t", "printed"),
    [
        ((1, 2, 1), (1, 1, 1), 0.0589),
        ((2, 1, 1), (1, 1, 1), 0.0589),
        ((1, 1, 2, 1, 1), (1,) * 5, 0.0487),
        ((1, 1, 1, 2, 1, 1, 1), (1,) * 7, 0.0398),
    ],
    ids=["6.6", "6.7", "6.8", "6.9"],
)
def test_equations_6_6_to_6_9(p, t, printed):
    assert kl_divergence(p, t) == pytest.approx(printed, abs=PRINTED)


@given(st.lists(st.floats(0.1, 1000), min_size=1, max_size=30), st.integers(0, 29))
def test_the_closed_form_is_the_divergence_when_one_bin_grows(counts, chosen):
    old = np.array(counts)
    new = old.copy()
    new[chosen % len(old)] += 1.0
    assert information_gain(old[chosen % len(old)], old.sum()) == pytest.approx(kl_divergence(new, old), rel=1e-9, abs=1e-13)


@given(st.floats(1, 1e9), st.floats(0, 1e9))
def test_a_gain_is_never_negative(count, others):
    assert information_gain(count, count + others) >= 0.0


@pytest.mark.parametrize(("p", "t"), [((1, 0), (1, 1)), ((1, 1), (1, 0)), ((1,), (1, 1)), ((), ()), ((1, np.nan), (1, 1))])
def test_divergence_is_refused_where_it_is_undefined(p, t):
    with pytest.raises(InvalidValue, match="bins"):
        kl_divergence(p, t)
