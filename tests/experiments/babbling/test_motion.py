from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.babbling.motion import beyond_limits, dimensionless_jerk, jerk, path_length
from experiments.babbling.trajectory import PositionMove

DT = 0.02


def course(way: float, speed: float, dt: float = 0.001) -> np.ndarray:
    move = PositionMove(np.zeros(1), np.array([way]), np.full(1, speed))
    return np.array([move.at(t) for t in np.arange(0.0, move.duration + dt / 2.0, dt)])


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


@given(way=st.floats(0.1, 2.0), speed=st.floats(0.1, 1.0))
def test_the_dimensionless_jerk_of_a_least_jerk_move_is_the_same_whatever_its_size_and_speed(way: float, speed: float) -> None:
    move = course(way, speed, dt=way / speed / 500.0)
    assert dimensionless_jerk(move, way / speed / 500.0) == pytest.approx(np.log(204.8), abs=0.05)


def test_a_move_that_goes_back_is_less_smooth() -> None:
    there = course(0.5, 0.5)
    stopped = np.concatenate([there[: len(there) // 2], there[len(there) // 2 :: -1]])
    assert dimensionless_jerk(stopped, 0.001) > dimensionless_jerk(there, 0.001) + 1.0


def test_what_does_not_move_has_no_jerk() -> None:
    assert dimensionless_jerk(np.ones((50, 3)), DT) is None
    assert dimensionless_jerk(np.zeros((3, 2)), DT) is None
