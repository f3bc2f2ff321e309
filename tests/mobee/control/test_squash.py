from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.control.squash import squash, squash_norm

vectors = st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=6).map(np.array)
sizes = st.floats(0.1, 100.0)


@given(vectors, sizes, sizes)
def test_every_dimension_stays_below_the_maximum_and_keeps_its_sign(v: np.ndarray, m: float, k: float) -> None:
    squashed = squash(v, m, k)
    assert np.all(np.abs(squashed) < m)
    assert np.all(squashed * v >= 0)


@given(sizes, sizes)
def test_the_slope_at_zero_is_k_and_far_out_the_maximum_is_reached(m: float, k: float) -> None:
    tiny = 1e-7 * m / k
    assert squash(np.array([tiny]), m, k)[0] / tiny == pytest.approx(k, rel=1e-5)
    assert squash(np.array([1e7 * m / k]), m, k)[0] == pytest.approx(m, rel=1e-5)


def test_the_figure_of_the_thesis() -> None:
    """Figure 5.2: m = 2, k = 3; half of the maximum at v = m / k."""
    assert squash(np.array([2.0 / 3.0, -2.0 / 3.0]), 2.0, 3.0) == pytest.approx([1.0, -1.0])


def test_dimensions_can_have_their_own_maximum() -> None:
    assert squash(np.array([1e9, 1e9]), np.array([1.0, 2.0]), 1.0) == pytest.approx([1.0, 2.0])


@given(vectors, sizes, sizes)
def test_the_norm_is_bounded_and_the_direction_kept(v: np.ndarray, m: float, k: float) -> None:
    squashed = squash_norm(v, m, k)
    assert np.linalg.norm(squashed) < m
    assert np.linalg.norm(squashed) * v == pytest.approx(np.linalg.norm(v) * squashed, rel=1e-9, abs=1e-9)


def test_a_batch_is_squashed_row_by_row(rng: np.random.Generator) -> None:
    batch = rng.normal(size=(4, 3))
    assert np.array_equal(squash_norm(batch, 2.0, 3.0), np.array([squash_norm(row, 2.0, 3.0) for row in batch]))
