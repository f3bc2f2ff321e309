from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from experiments.babbling.trajectory import PositionMove

angles = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3).map(np.array)


@given(start=angles, target=angles, speed=st.floats(0.05, 2.0))
def test_a_move_goes_from_start_to_target_within_its_speed(start: np.ndarray, target: np.ndarray, speed: float) -> None:
    move = PositionMove(start, target, np.full(3, speed))
    times = np.linspace(0.0, move.duration, 400)
    course = np.array([move.at(t) for t in times])
    assert np.array_equal(course[0], start)
    assert np.allclose(course[-1], target) and np.allclose(move.at(move.duration + 9.0), target)
    if move.duration > 0.0:
        assert np.abs(np.diff(course, axis=0)).max() / (times[1] - times[0]) <= speed * (1.0 + 1e-6)
    assert (np.diff(course, axis=0) * np.sign(target - start) >= -1e-12).all()


def test_the_speed_is_reached_and_the_jerk_is_least() -> None:
    move = PositionMove(np.zeros(1), np.ones(1), np.full(1, 0.5))
    times = np.linspace(0.0, move.duration, 2001)
    course = np.array([move.at(t)[0] for t in times])
    assert np.isclose(np.gradient(course, times).max(), 0.5, rtol=1e-4)
    assert np.abs(np.diff(course, n=6)).max() < 1e-12  # a polynomial of fifth degree


def test_a_motor_with_a_short_way_does_not_wait_for_the_others() -> None:
    move = PositionMove(np.zeros(2), np.array([1.0, 0.1]), np.ones(2))
    assert move.at(0.2 * move.duration)[1] == 0.1
    assert move.at(0.2 * move.duration)[0] < 0.2
