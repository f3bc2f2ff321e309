from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee.errors import InvalidValue
from mobee.roadmap.ik import costs


def test_relative_position_is_how_far_a_marker_is_from_a_place_that_goes_with_another(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    place = np.array([0.02, -0.01, -0.2])
    there = pose.position("left_palm") + (pose.rotation("left_palm") @ place[:, None])[..., 0]
    missing = costs.relative_position("right_palm", "left_palm", place).residual(pose)
    np.testing.assert_allclose(missing, np.linalg.norm(pose.position("right_palm") - there, axis=1), atol=1e-14)


def test_relative_orientation_is_the_turn_between_two_markers(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    between = pose.rotation("left_palm").swapaxes(-1, -2) @ pose.rotation("right_palm")
    missing = costs.relative_orientation("right_palm", "left_palm", np.eye(3)).residual(pose)
    np.testing.assert_allclose(missing, np.arccos((np.trace(between, axis1=1, axis2=2) - 1.0) / 2.0), atol=1e-7)
    assert costs.relative_orientation("right_palm", "left_palm", between[2]).residual(pose)[2] == pytest.approx(0.0, abs=1e-7)


def test_aligned_is_the_angle_between_directions_of_two_markers(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    fingers, thumb = pose.rotation("left_palm")[..., 0], -pose.rotation("right_palm")[..., 1]
    missing = costs.aligned("left_palm", "right_palm", (3.0, 0.0, 0.0), (0.0, -1.0, 0.0)).residual(pose)
    np.testing.assert_allclose(missing, np.arccos((fingers * thumb).sum(axis=1)), atol=1e-7)


def test_orientation_of_a_direction_of_the_markers_own(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    missing = costs.orientation("right_palm", (0.0, 0.0, 5.0), direction=(-2.0, 0.0, 0.0)).residual(pose)
    np.testing.assert_allclose(missing, np.arccos(-pose.rotation("right_palm")[:, 2, 0]), atol=1e-7)


def test_a_point_of_the_markers_frame_can_be_put_on_a_place(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    points = pose.position("left_palm") + (pose.rotation("left_palm") @ np.array([[0.1], [0.0], [-0.2]]))[..., 0]
    missing = costs.position("left_palm", points[1], offset=(0.1, 0.0, -0.2)).residual(pose)
    np.testing.assert_allclose(missing, np.linalg.norm(points - points[1], axis=1), atol=1e-14)


def test_across_is_the_angle_to_the_plane_across_an_axis(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    tilted = np.abs(np.pi / 2 - np.arccos(pose.normal("right_palm")[:, 2]))
    np.testing.assert_allclose(costs.across("right_palm", (0, 0, 3)).residual(pose), tilted, atol=1e-7)
    fingers = np.abs(np.pi / 2 - np.arccos(pose.rotation("right_palm")[:, 2, 0]))
    np.testing.assert_allclose(costs.across("right_palm", (0, 0, 3), (1, 0, 0)).residual(pose), fingers, atol=1e-7)


def test_plane_is_the_distance_to_it_on_either_side_and_at_most_that_beyond_it(free: mobee.Model, postures: np.ndarray) -> None:
    pose = free.evaluate(postures)
    heights = pose.position("left_elbow")[:, 2]
    middle = float(np.median(heights))
    np.testing.assert_allclose(costs.plane("left_elbow", (0, 0, 2), middle).residual(pose), np.abs(heights - middle), atol=1e-15)
    beyond = costs.at_most("left_elbow", (0, 0, 2), middle).residual(pose)
    np.testing.assert_allclose(beyond, np.maximum(heights - middle, 0.0), atol=1e-15)
    assert (beyond == 0.0).any() and (beyond > 0.0).any()


@pytest.mark.parametrize("goal", [np.diag([1.0, 1.0, -1.0]), np.eye(2), [[np.nan] * 3] * 3])
def test_what_is_no_rotation_is_refused(goal: np.ndarray) -> None:
    with pytest.raises(InvalidValue, match="goal is no rotation"):
        costs.relative_orientation("right_palm", "left_palm", goal)
