# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.model.kinematics import link_transforms
from tests.mobee.model.kinematics_oracle import Pinocchio
from tests.mobee.planar import LENGTH, planar_arm, tree

SEEDS = st.integers(0, 10_000)


def test_every_link_is_where_it_was_drawn_at_zero_pose():
    robot = planar_arm()
    assert np.array_equal(link_transforms(robot, np.zeros(3)), np.tile(np.eye(4), (4, 1, 1)))


def test_planar_arm_folds_as_trigonometry_says():
    robot = planar_arm()
    a, b, c = 0.3, -0.7, 1.1
    tip = link_transforms(robot, np.array([a, b, c]))[3] @ np.array([3 * LENGTH, 0.0, 0.0, 1.0])
    sums = np.cumsum([a, b, c])
    assert tip[:3] == pytest.approx([LENGTH * np.cos(sums).sum(), LENGTH * np.sin(sums).sum(), 0.0], abs=1e-15)


@given(SEEDS)
def test_links_agree_with_pinocchio(seed):
    robot = tree(seed % 7)
    oracle = Pinocchio(robot)
    rng = np.random.default_rng(seed)
    q = rng.uniform(-3, 3, len(robot.motors))
    point = rng.uniform(-1, 1, 3)
    moved = link_transforms(robot, q)[:, :3, :] @ np.append(point, 1.0)
    for link in range(len(robot.links)):
        assert moved[link] == pytest.approx(oracle.moved(q, link, point), abs=1e-12)


@given(SEEDS)
def test_transforms_are_rigid_motions(seed):
    robot = tree(seed % 7)
    q = np.random.default_rng(seed).uniform(-3, 3, (5, len(robot.motors)))
    t = link_transforms(robot, q)
    rotation = t[..., :3, :3]
    assert np.abs(rotation @ np.swapaxes(rotation, -1, -2) - np.eye(3)).max() < 1e-13
    assert np.linalg.det(rotation).min() > 0.0
    assert np.array_equal(t[..., 3, :], np.broadcast_to([0.0, 0.0, 0.0, 1.0], t[..., 3, :].shape))


def test_a_batch_equals_its_poses_one_by_one(rng):
    robot = tree(3)
    q = rng.uniform(-3, 3, (4, 5, len(robot.motors)))
    batch = link_transforms(robot, q)
    assert batch.shape == (4, 5, len(robot.links), 4, 4)
    for index in np.ndindex(4, 5):
        assert batch[index] == pytest.approx(link_transforms(robot, q[index]), abs=1e-14)
