# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pinocchio
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.model.kinematics import matrix_from_quaternion, quaternion_from_matrix


@given(st.integers(0, 10_000))
def test_order_and_sense_are_those_of_pinocchio(seed):
    xyzw = np.random.default_rng(seed).normal(size=4)
    other = pinocchio.Quaternion(xyzw).normalized()
    wxyz = np.roll(other.coeffs(), 1)
    assert matrix_from_quaternion(wxyz) == pytest.approx(other.matrix(), abs=1e-14)
    assert quaternion_from_matrix(other.matrix()) == pytest.approx(wxyz * np.sign(wxyz[0]), abs=1e-14)


def test_no_turn_is_one_zero_zero_zero():
    assert np.array_equal(quaternion_from_matrix(np.eye(3)), [1.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("axis", range(3))
def test_half_turns_lose_no_digits(axis):
    q = np.zeros(4)
    q[axis + 1] = 1.0
    assert np.abs(quaternion_from_matrix(matrix_from_quaternion(q))) == pytest.approx(q, abs=1e-15)


def test_batches_keep_their_leading_dimensions(rng):
    q = rng.normal(size=(2, 3, 4))
    matrices = matrix_from_quaternion(q)
    back = quaternion_from_matrix(matrices)
    assert back.shape == (2, 3, 4)
    assert matrix_from_quaternion(back) == pytest.approx(matrices, abs=1e-14)
