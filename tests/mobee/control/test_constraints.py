# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.control import Gains
from mobee.robot.robot import Clause
from tests.mobee.control.posed_forces import forces_at
from tests.mobee.control.two_parts import two_part_arm

WIDTH, MAXIMUM = 0.2, 30.0
PLANE = Clause("arm", np.array([[1.71, -1.71, 0.0]]), np.array([0.5]))
EITHER = Clause("arm", np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]), np.array([0.0, 0.0]))  # q0 > 0 or q1 > 0
angles = st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3).map(np.array)


def force(clauses: list[Clause], q: np.ndarray) -> np.ndarray:
    gains = replace(Gains.default(), constraint_width=WIDTH, max_constraint=MAXIMUM)
    return forces_at(replace(two_part_arm(), clauses=tuple(clauses)), gains, q).constraints


def on_plane(depth: float) -> np.ndarray:
    """A point `depth` rad behind the boundary of PLANE, along its normal."""
    normal = PLANE.a[0] / np.linalg.norm(PLANE.a[0])
    return -normal * (PLANE.b[0] / np.linalg.norm(PLANE.a[0]) + depth)


def test_no_push_where_the_row_is_satisfied_with_margin() -> None:
    assert not force([PLANE], on_plane(-WIDTH - 1e-9)).any()


@pytest.mark.parametrize(("depth", "share"), [(0.0, 1.0), (-WIDTH / 2, 0.5), (WIDTH, 2.0)])
def test_the_push_is_linear_along_the_normal_to_the_maximum_at_the_boundary_and_beyond(depth: float, share: float) -> None:
    expected = share * MAXIMUM * np.array([1.0, -1.0, 0.0]) / np.sqrt(2.0)
    assert force([PLANE], on_plane(depth)) == pytest.approx(expected, abs=1e-9)


def test_a_clause_is_quiet_while_one_of_its_rows_is_satisfied_with_margin() -> None:
    assert not force([EITHER], np.array([-1.0, 0.3, 0.0])).any()
    assert not force([EITHER], np.array([0.3, -1.0, 0.0])).any()
    assert np.all(force([EITHER], np.array([-0.1, -0.1, 0.0]))[:2] > 0)


@given(angles, st.integers(0, 2))
def test_the_force_is_continuous_where_the_rows_of_a_clause_take_turns(q: np.ndarray, axis: int) -> None:
    step = np.zeros(3)
    step[axis] = 1e-7
    assert np.linalg.norm(force([EITHER, PLANE], q + step) - force([EITHER, PLANE], q)) < 4 * MAXIMUM / WIDTH * 1e-7


def test_clauses_add_up() -> None:
    q = np.array([-0.2, 0.2, -0.3])
    assert force([PLANE, EITHER], q) == pytest.approx(force([PLANE], q) + force([EITHER], q))


def test_a_robot_without_constraints_has_no_constraint_force() -> None:
    assert np.array_equal(force([], np.zeros(3)), np.zeros(3))
    assert np.array_equal(published([0.0, 0.0, 0.0], []), np.zeros(3))


def published(degrees: list[float], clauses: list[Clause]) -> np.ndarray:
    robot = replace(two_part_arm(), clauses=tuple(clauses))
    return np.rad2deg(forces_at(robot, Gains.published_2014(), np.deg2rad(degrees)).constraints)


def test_the_published_law_counts_in_units_of_the_row() -> None:
    """Row 0 of the shoulder, 1.71 pitch - 1.71 roll + 347 > 0: at pitch -60, roll 120 the row is worth 39.2 of 40."""
    row = Clause("arm", np.array([[1.71, -1.71, 0.0]]), np.deg2rad([347.0]))
    push = 1500.0 * (40.0 - 39.2) / 40.0 / np.sqrt(2.0)
    assert published([-60.0, 120.0, 0.0], [row]) == pytest.approx([push, -push, 0.0])


def test_the_published_law_clips_the_sum_to_one_a_motor() -> None:
    row = Clause("arm", np.array([[0.0, -1.0, -1.0]]), np.deg2rad([213.3]))
    assert published([0.0, 161.0, 150.0], [row]) == pytest.approx([0.0, -1500.0, -1500.0])


def test_the_published_law_sums_a_clause_only_when_all_its_rows_are_short_of_the_margin() -> None:
    elbow_or_wrist = Clause("arm", np.array([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), np.deg2rad([90.0, 45.0]))
    assert not published([100.0, 0.0, 0.0], [elbow_or_wrist]).any()  # 45 left on the second row
    assert published([80.0, 25.0, 0.0], [elbow_or_wrist]) == pytest.approx([-1500.0 * 0.75, -1500.0 * 0.5, 0.0])
