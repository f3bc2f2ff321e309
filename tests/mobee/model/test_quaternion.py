from __future__ import annotations

import numpy as np
import pinocchio
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.model import quaternion


@given(st.integers(0, 10_000))
def test_order_and_sense_are_those_of_pinocchio(seed):
    xyzw = np.random.default_rng(seed).normal(size=4)
    other = pinocchio.Quaternion(xyzw).normalized()
    wxyz = np.roll(other.coeffs(), 1)
    assert quaternion.to_matrix(wxyz) == pytest.approx(other.matrix(), abs=1e-14)
    assert quaternion.from_matrix(other.matrix()) == pytest.approx(wxyz * np.sign(wxyz[0]), abs=1e-14)


def test_no_turn_is_one_zero_zero_zero():
    assert np.array_equal(quaternion.from_matrix(np.eye(3)), [1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("axis", range(3))
def test_half_turns_lose_no_digits(axis):
    q = np.zeros(4)
    q[axis + 1] = 1.0
    assert np.abs(quaternion.from_matrix(quaternion.to_matrix(q))) == pytest.approx(q, abs=1e-15)


def test_batches_keep_their_leading_dimensions(rng):
    q = rng.normal(size=(2, 3, 4))
    matrices = quaternion.to_matrix(q)
    back = quaternion.from_matrix(matrices)
    assert back.shape == (2, 3, 4)
    assert quaternion.to_matrix(back) == pytest.approx(matrices, abs=1e-14)
