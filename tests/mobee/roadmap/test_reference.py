# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee.errors import InvalidValue
from mobee.roadmap.playback import reference, rounded

SPEEDS, ACCELERATIONS = np.array([0.3, 0.1, 0.5]), np.array([2.0, 1.0, 5.0])
DT = 0.01


def walk(seed: int, count: int, size: float) -> np.ndarray:
    return np.cumsum(np.random.default_rng(seed).normal(size=(count, 3)) * size, axis=0)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 7), st.sampled_from([0.01, 0.1, 0.5]), st.sampled_from([0.0, 0.05, 1.0]))
def test_no_motor_is_too_fast_or_too_hard_and_both_ends_are_reached_at_rest(seed: int, count: int, size: float, rounding: float) -> None:
    path = walk(seed, count, size)
    found = reference(path, SPEEDS, ACCELERATIONS, rounding, DT)
    np.testing.assert_array_equal(found.q[[0, -1]], path[[0, -1]])
    assert (found.velocity[[0, -1]] == 0.0).all()
    np.testing.assert_allclose(np.diff(found.times), DT, atol=1e-12)
    steps = np.diff(found.q, axis=0) / DT
    assert (np.abs(steps) <= SPEEDS + 1e-12).all()
    assert (np.abs(np.diff(steps, axis=0)) / DT <= ACCELERATIONS + 1e-9).all()


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.02, 0.1, 0.3]))
def test_the_motion_stays_within_half_the_rounding_of_the_path(seed: int, rounding: float) -> None:
    path = walk(seed, 5, 0.2)
    found = reference(path, SPEEDS, ACCELERATIONS, rounding, DT)
    share = np.linspace(0.0, 1.0, 200)[:, None, None]
    dense = (path[:-1] + share * np.diff(path, axis=0)).reshape(-1, 3)
    apart = np.linalg.norm(found.q[:, None] - dense, axis=2).min(axis=1)
    assert apart.max() <= 0.5 * rounding + 0.004


def test_without_rounding_it_stops_at_every_corner() -> None:
    path = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.2, 0.1, 0.0]])
    found = reference(path, SPEEDS, ACCELERATIONS, 0.0, DT)
    corner = np.linalg.norm(found.q - path[1], axis=1).argmin()
    np.testing.assert_allclose(found.q[corner], path[1], atol=1e-12)
    assert np.abs(found.velocity[corner]).max() < 0.05
    assert np.abs(found.q[:corner, 1]).max() < 1e-9 and np.abs(found.q[corner:, 0] - 0.2).max() < 1e-9


def test_rounded_corners_are_passed_without_a_stop() -> None:
    path = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.4, 0.05, 0.0], [0.6, 0.05, 0.1]])
    found = reference(path, SPEEDS, ACCELERATIONS, 0.1, DT)
    middle = found.velocity[20:-20]
    assert np.linalg.norm(middle, axis=1).min() > 0.05
    assert found.times[-1] < reference(path, SPEEDS, ACCELERATIONS, 0.0, DT).times[-1]


def test_a_long_path_is_followed_at_full_speed() -> None:
    found = reference([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]], SPEEDS, ACCELERATIONS, 0.1, DT)
    assert found.velocity[:, 0].max() == pytest.approx(0.3, rel=0.03)
    assert found.times[-1] == pytest.approx(3.0 / 0.3 + 0.3 / 1.0, rel=0.05)


def test_a_path_of_one_place_is_a_motion_that_stays() -> None:
    for path in ([[0.1, 0.2, 0.3]], [[0.1, 0.2, 0.3]] * 3):
        found = reference(path, SPEEDS, ACCELERATIONS)
        np.testing.assert_array_equal(found.q, [[0.1, 0.2, 0.3]])
        assert found.times.tolist() == [0.0] and not found.velocity.any()


def test_a_path_may_go_back_and_forth() -> None:
    found = reference([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.0, 0.0]], SPEEDS, ACCELERATIONS, 0.1, DT)
    assert found.q[:, 0].max() == pytest.approx(0.25, abs=0.003)  # turned round at half of the rounding before the corner
    assert np.linalg.norm(np.diff(rounded([[0.0], [1.0], [0.0]], 0.1), axis=0), axis=1).max() < 0.005
    with pytest.raises(InvalidValue, match="corners: 1 and the next one are equal"):
        rounded([[0.0], [1.0], [1.0], [0.0]], 0.1)


@pytest.mark.parametrize("far", [0.011, 0.022, 0.05, 0.13])
@pytest.mark.parametrize("rounding", [0.1, 0.0251])
def test_a_path_of_any_length_may_turn_back_on_itself(far: float, rounding: float) -> None:
    corners = np.array([[0.0, 0.0, 0.0], [far, 0.0, 0.5 * far], [0.0, 0.0, 0.0]])
    found = reference(corners, SPEEDS, ACCELERATIONS, rounding, DT)
    np.testing.assert_array_equal(found.q[-1], corners[-1])
    assert 0.5 * far < found.q[:, 0].max() <= far


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"path": np.zeros(3)}, "path has shape"),
        ({"speeds": [0.1, 0.1]}, "speeds have shape"),
        ({"accelerations": [1.0, 0.0, 1.0]}, "accelerations have shape"),
        ({"rounding": -0.1}, "rounding -0.1"),
    ],
)
def test_invalid_input_is_refused(change: dict, text: str) -> None:
    with pytest.raises(InvalidValue, match=text):
        reference(**({"path": walk(0, 3, 0.1), "speeds": SPEEDS, "accelerations": ACCELERATIONS} | change))
