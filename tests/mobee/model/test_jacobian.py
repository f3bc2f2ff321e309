# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.model.kinematics import joint_axes, link_transforms, point_jacobian
from tests.mobee.model.kinematics_oracle import Pinocchio
from tests.mobee.planar import planar_arm, tree

SEEDS = st.integers(0, 10_000)
STEP = 1e-5


def _drawn(seed):
    robot = tree(seed % 7)
    rng = np.random.default_rng(seed)
    return robot, rng.uniform(-2, 2, len(robot.motors)), rng.uniform(-1, 1, 3)


@given(SEEDS)
def test_jacobian_of_every_link_is_the_derivative_of_its_motion(seed):
    robot, q, point = _drawn(seed)
    now = link_transforms(robot, q)
    steps = STEP * np.eye(len(q))
    ahead, behind = link_transforms(robot, q + steps), link_transforms(robot, q - steps)
    for link in range(len(robot.links)):
        here = now[link] @ np.append(point, 1.0)
        jacobian = point_jacobian(robot, now, link, here[:3])
        moved = (ahead[:, link] - behind[:, link]) / (2 * STEP)
        linear = (moved @ np.append(point, 1.0))[:, :3].T
        spin = moved[:, :3, :3] @ now[link, :3, :3].T  # the skew matrix of the angular velocity
        angular = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]])
        # Central differences: h^2 times the third derivative (some 10 m) plus rounding 1e-15 / h.
        assert np.abs(jacobian - np.vstack([linear, angular])).max() < 2e-8


@given(SEEDS)
def test_jacobian_agrees_with_pinocchio(seed):
    robot, q, point = _drawn(seed)
    oracle = Pinocchio(robot)
    now = link_transforms(robot, q)
    for link in range(len(robot.links)):
        here = (now[link] @ np.append(point, 1.0))[:3]
        assert point_jacobian(robot, now, link, here) == pytest.approx(oracle.jacobian(q, link, point), abs=1e-12)


def test_a_batch_equals_its_poses_one_by_one(rng):
    robot = tree(1)
    q = rng.uniform(-3, 3, (4, len(robot.motors)))
    points = rng.uniform(-1, 1, (4, 3))
    transforms = link_transforms(robot, q)
    batch = point_jacobian(robot, transforms, 9, points)
    assert batch.shape == (4, 6, len(robot.motors))
    for i in range(4):
        assert batch[i] == pytest.approx(point_jacobian(robot, transforms[i], 9, points[i]), abs=1e-14)


def test_joint_axes_turn_with_the_arm():
    robot = planar_arm()
    axes, points = joint_axes(robot, link_transforms(robot, np.array([np.pi / 2, 0.0, 0.0])))
    assert axes == pytest.approx(np.tile([0.0, 0.0, 1.0], (3, 1)), abs=1e-15)
    assert points == pytest.approx(np.array([[0.0, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.6, 0.0]]), abs=1e-15)


def test_nothing_moves_the_base():
    robot = planar_arm()
    assert not point_jacobian(robot, link_transforms(robot, np.ones(3)), 0, np.ones(3)).any()
