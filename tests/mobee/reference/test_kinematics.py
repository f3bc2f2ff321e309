# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.model import kinematics
from mobee.model.masses import gravity_torque
from mobee.model.model import Model
from mobee.reference.kinematics import cross_matrix, jacobian, link_frames, marker_at, marker_jacobian, moved, rotation, weight_torque
from mobee.robot.load import load_robot
from tests.mobee.planar import LENGTH, planar_arm
from tests.mobee.reference.drawn import drawn_pose, drawn_robot

SEEDS = st.integers(0, 2**32 - 1)
STEP = 1e-5
# Sines come from other formulas and products in another order: a few units of the last place for each joint of the chain.
ROUNDING = 1e-12


@given(SEEDS)
def test_a_rotation_turns_about_its_axis(seed: int) -> None:
    rng = np.random.default_rng(seed)
    axis, angle = rng.normal(size=3), float(rng.uniform(-7.0, 7.0))
    axis /= np.linalg.norm(axis)
    turn = rotation(axis, angle)
    assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-14)
    assert turn @ axis == pytest.approx(axis)
    across = np.cross(axis, rng.normal(size=3))
    assert turn @ across == pytest.approx(np.cos(angle) * across + np.sin(angle) * np.cross(axis, across))
    assert cross_matrix(axis) @ across == pytest.approx(np.cross(axis, across))


def test_the_tip_of_a_planar_arm_is_where_trigonometry_puts_it() -> None:
    q = np.array([0.4, -0.7, 1.1])
    angles = np.cumsum(q)
    place, normal = marker_at(planar_arm(), link_frames(planar_arm(), q), "tip")
    assert place == pytest.approx([LENGTH * np.cos(angles).sum(), LENGTH * np.sin(angles).sum(), 0.0])
    assert normal == pytest.approx([np.cos(angles[-1]), np.sin(angles[-1]), 0.0])


@given(SEEDS)
def test_the_jacobian_is_the_derivative_of_a_points_motion(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = drawn_robot(rng)
    q, point, link = drawn_pose(rng, robot), rng.uniform(-1.0, 1.0, 3), int(rng.integers(len(robot.links)))
    now = link_frames(robot, q)
    found = jacobian(robot, now, link, moved(now[link], point))
    for motor in range(len(q)):
        step = STEP * np.eye(len(q))[motor]
        ahead, behind = (link_frames(robot, q + side * step)[link] for side in (1.0, -1.0))
        assert found[:3, motor] == pytest.approx((moved(ahead, point) - moved(behind, point)) / (2.0 * STEP), abs=1e-7)
        spin = (ahead - behind)[:3, :3] / (2.0 * STEP) @ now[link, :3, :3].T
        assert cross_matrix(found[3:, motor]) == pytest.approx(spin, abs=1e-7)


@given(SEEDS)
def test_links_markers_and_jacobians_of_the_model_are_these(seed: int) -> None:
    rng = np.random.default_rng(seed)
    robot = drawn_robot(rng)
    model, q = Model(robot), drawn_pose(rng, robot)
    pose, frames = model.evaluate(q), link_frames(robot, q)
    assert pose.transforms == pytest.approx(frames, abs=ROUNDING)
    assert kinematics.link_transforms(robot, q) == pytest.approx(frames, abs=ROUNDING)
    for marker in robot.markers:
        place, normal = marker_at(robot, frames, marker)
        assert pose.position(marker) == pytest.approx(place, abs=ROUNDING)
        assert pose.normal(marker) == pytest.approx(normal, abs=ROUNDING)
        expected = marker_jacobian(robot, q, marker)
        assert model.jacobian(q, marker) == pytest.approx(expected, abs=ROUNDING)
        assert kinematics.point_jacobian(robot, frames, robot.marker(marker).link, place) == pytest.approx(expected, abs=ROUNDING)


@pytest.mark.parametrize("name", ["icub", "icub_2014", "katana"])
def test_shipped_robots_are_where_the_definition_puts_them(name: str, rng: np.random.Generator) -> None:
    robot = load_robot(name)
    q = rng.uniform(*robot.limits.T, (5, len(robot.motors)))
    batch = Model(robot).evaluate(q)
    for one, links in zip(q, batch.transforms, strict=True):
        assert links == pytest.approx(link_frames(robot, one), abs=1e-14)
        assert gravity_torque(robot, one) == pytest.approx(weight_torque(robot, one), abs=1e-10)  # N m, of some ten
