# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.arrays import Array
from mobee.control.reach import bend_bound, reach_path
from mobee.errors import InvalidValue, UnknownName
from mobee.model.model import Model
from mobee.robot.load import load_robot
from tests.mobee.planar import planar_arm

ARM = Model(planar_arm())
ICUB = Model(load_robot("icub"))
BENT = np.array([0.3, 0.7, 0.4])
poses = st.lists(st.floats(-1.5, 1.5), min_size=3, max_size=3).map(np.array)


def errors(model: Model, marker: str, position: Array, path: Array) -> Array:
    return np.linalg.norm(model.evaluate(path).position(marker) - position, axis=-1)


@given(poses)
def test_a_step_never_takes_the_marker_away_from_the_target(goal: Array) -> None:
    position = ARM.evaluate(goal).position("tip")
    path = reach_path(ARM, "tip", position, BENT)
    assert np.all(np.diff(errors(ARM, "tip", position, path.q)) <= 1e-12)


@pytest.mark.parametrize("with_normal", [False, True])
def test_the_icubs_hand_reaches_where_it_can(with_normal: bool) -> None:
    robot, rng = ICUB.robot, np.random.default_rng(1)
    for _ in range(3):
        there = ICUB.evaluate(robot.limits[:, 0] + rng.uniform(0.2, 0.8, len(robot.motors)) * np.ptp(robot.limits, axis=1))
        normal = there.normal("left_palm") if with_normal else None
        path = reach_path(ICUB, "left_palm", there.position("left_palm"), robot.home, normal, steps=5000)
        assert path.end == "reached" and path.distance <= 1e-3
        end = ICUB.evaluate(path.q[-1])
        assert end.position("left_palm") == pytest.approx(there.position("left_palm"), abs=1e-3)
        if normal is not None:
            assert end.normal("left_palm") @ normal > np.cos(1.1e-3)
        assert np.all((path.q >= robot.limits[:, 0]) & (path.q <= robot.limits[:, 1]))


def test_out_of_reach_it_ends_stuck_at_the_nearest_point() -> None:
    path = reach_path(ARM, "tip", np.array([0.0, 1.1, 0.0]), BENT)
    assert path.end == "stuck"
    assert path.distance == pytest.approx(0.2, abs=1e-4)


def test_a_normal_out_of_reach_ends_stuck_with_the_remaining_angle() -> None:
    path = reach_path(ARM, "tip", ARM.evaluate(BENT).position("tip"), BENT, np.array([0.0, 0.0, 1.0]))
    assert path.end == "stuck"
    assert path.angle == pytest.approx(np.pi / 2, abs=1e-3)  # the arm moves in the plane of x and y


@given(poses, st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6).map(np.array), poses)
def test_the_bound_of_the_bend_holds_for_every_motion(q: Array, error: Array, along: Array) -> None:
    """For the second derivative of the marker's position and turn along a straight line of postures, by differences."""
    h = 1e-4

    def rows(at: Array) -> Array:
        return ARM.jacobian(at, "tip") * np.repeat([1.0, 0.1], 3)[:, None]

    bend = (rows(q + h * along) - rows(q - h * along)) @ along / (2.0 * h)
    assert abs(error @ bend) <= bend_bound(ARM.jacobian(q, "tip"), error) * (along @ along) + 1e-6


@pytest.mark.parametrize("row", [3, 4, 5])
def test_a_turn_about_any_axis_adds_to_the_bound_of_the_bend(row: int) -> None:
    error = np.eye(6)[row]
    assert bend_bound(ARM.jacobian(BENT, "tip"), error) == pytest.approx(0.1 * np.linalg.norm(ARM.jacobian(BENT, "tip")[3:]) ** 2)


def test_in_a_singular_pose_it_is_stuck_at_the_start_as_the_thesis_warns() -> None:
    path = reach_path(ARM, "tip", np.array([0.5, 0.0, 0.0]), np.zeros(3))
    assert path.end == "stuck" and len(path.q) == 1
    assert path.distance == pytest.approx(0.4)


def test_it_says_when_its_steps_are_used_up() -> None:
    path = reach_path(ARM, "tip", np.array([-0.5, 0.3, 0.0]), BENT, steps=3)
    assert path.end == "steps used up" and len(path.q) == 4


def test_a_step_goes_where_the_error_falls_fastest() -> None:
    """Of |dx|^2 / 2 + ARM^2 (1 - n.n*), along J^T dx."""
    position, normal = np.array([0.0, 0.4, 0.0]), np.array([0.0, 3.0, 0.0])

    def error(q: Array) -> float:
        pose = ARM.evaluate(q)
        offset = position - pose.position("tip")
        return float(offset @ offset / 2.0 + 0.1**2 * (1.0 - pose.normal("tip") @ [0.0, 1.0, 0.0]))

    slope = np.array([(error(BENT + step) - error(BENT - step)) / 2e-6 for step in 1e-6 * np.eye(3)])
    step = np.diff(reach_path(ARM, "tip", position, BENT, normal, steps=1).q, axis=0)[0]
    assert step / np.linalg.norm(step) == pytest.approx(-slope / np.linalg.norm(slope), abs=1e-6)


def test_an_invalid_target_is_refused() -> None:
    with pytest.raises(UnknownName, match="marker 'tpi'. Did you mean 'tip'"):
        reach_path(ARM, "tpi", np.zeros(3), BENT)
    with pytest.raises(InvalidValue, match="position .*three finite numbers"):
        reach_path(ARM, "tip", np.array([0.0, np.nan, 0.0]), BENT)
    with pytest.raises(InvalidValue, match="normal .*not be all 0"):
        reach_path(ARM, "tip", np.zeros(3), BENT, normal=np.zeros(3))
    for tolerance, steps in ((-1.0, 10), ("small", 10), (1e-3, "all"), (1e-3, 0)):
        with pytest.raises(InvalidValue, match=f"tolerance {tolerance!r} and {steps!r} steps"):
            reach_path(ARM, "tip", np.zeros(3), BENT, tolerance=tolerance, steps=steps)
    for start in (np.stack([BENT, BENT]), BENT[:2], np.nan * BENT):
        with pytest.raises(InvalidValue, match="start.*finite numbers"):
            reach_path(ARM, "tip", np.zeros(3), start)
