# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.mobee.control.one_law import OneLaw

vectors = st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=6).map(np.array)
sizes = st.floats(0.1, 100.0)


def each(v: np.ndarray, m: float, k: float) -> np.ndarray:
    """As a client's force is bounded, motor by motor."""
    return OneLaw(len(v), max_client=m, client_knee=m / k).client(v)


def squash(v: float, m: float, k: float) -> float:
    return float(each(np.array([v]), m, k)[0])


def whole(v: np.ndarray, m: float, k: float) -> np.ndarray:
    """As the force of contacts is bounded, by its norm."""
    return OneLaw(len(v), law={"contact_gain": 1.0, "max_contact": m, "contact_slope": k}).force("collision", np.zeros(len(v)), v)


@given(vectors, sizes, sizes)
def test_every_dimension_stays_below_the_maximum_and_keeps_its_sign(v: np.ndarray, m: float, k: float) -> None:
    squashed = each(v, m, k)
    assert np.all(np.abs(squashed) < m)
    assert np.all(squashed * v >= 0)


@given(sizes, sizes)
def test_the_slope_at_zero_is_k_and_far_out_the_maximum_is_reached(m: float, k: float) -> None:
    tiny = 1e-7 * m / k
    assert squash(tiny, m, k) / tiny == pytest.approx(k, rel=1e-5)
    assert squash(1e7 * m / k, m, k) == pytest.approx(m, rel=1e-5)


def test_the_figure_of_the_thesis() -> None:
    """Figure 5.2: m = 2, k = 3; half of the maximum at v = m / k."""
    assert [squash(v, 2.0, 3.0) for v in (2.0 / 3.0, -2.0 / 3.0)] == pytest.approx([1.0, -1.0])


@given(vectors, sizes, sizes)
def test_the_norm_is_bounded_and_the_direction_kept(v: np.ndarray, m: float, k: float) -> None:
    squashed = whole(v, m, k)
    assert np.linalg.norm(squashed) < m
    assert np.linalg.norm(squashed) * v == pytest.approx(np.linalg.norm(v) * squashed, rel=1e-9, abs=1e-9)
