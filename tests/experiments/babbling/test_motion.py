from __future__ import annotations

import numpy as np
import pytest

from experiments.babbling.motion import beyond_limits, jerk, path_length, speed

DT = 0.02


def test_beyond_a_limit_is_positive_and_inside_negative() -> None:
    q = np.array([[0.0, 0.5], [0.2, 1.25], [-1.5, 0.0]])
    limits = np.array([[-1.0, 1.0], [-1.0, 1.0]])
    assert np.allclose(beyond_limits(q, limits), [0.5, 0.25])
    assert np.allclose(beyond_limits(0.5 * q, limits), [-0.25, -0.375])


def test_the_path_counts_the_way_back() -> None:
    assert path_length(np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 0.5]])) == pytest.approx(2.0)


def test_the_jerk_of_a_cubic_is_constant() -> None:
    t = np.arange(10) * DT
    assert np.allclose(jerk(np.column_stack([t**3, -2.0 * t**3]), DT), [6.0, -12.0])


def test_the_speed_is_the_first_difference() -> None:
    assert np.allclose(speed(np.array([[0.0, 1.0], [0.1, 1.0], [0.1, 0.9]]), DT), [[5.0, 0.0], [0.0, -5.0]])
