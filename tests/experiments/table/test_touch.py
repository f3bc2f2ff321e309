from __future__ import annotations

import numpy as np

from experiments.kit.arm_learning import robot
from experiments.table.touch import is_forward, low_goals, near_table


def bent(degrees):
    q = robot().home.copy()
    q[robot().motor_index("torso_pitch")] = np.deg2rad(degrees)
    return q


def test_a_hand_is_near_the_table_when_the_torso_is_bent_and_nearer_with_a_larger_margin():
    poses = np.array([bent(0.0), bent(25.0), bent(70.0)])
    touching, near = near_table(poses, "left_arm", 0.0), near_table(poses, "left_arm", 0.2)
    assert not touching[0]
    assert touching[2]
    assert near.sum() >= touching.sum()
    assert is_forward(poses).tolist() == [False, False, True]


def test_low_goals_are_the_same_for_both_arms():
    left, right = low_goals("left_arm"), low_goals("right_arm")
    assert (left == right).all()
    assert 20 < left.sum() < 40
