# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.kit.reaching.toy_arm import (
    FORE,
    MARKER,
    MAX_REACH,
    STARTS,
    UPPER,
    ToyArm,
    blocked,
    grid,
    hands,
    missing,
    oracle,
    swept,
    toy_space,
    true_rewards,
)
from mobee.reach import reward_of

RANGES = np.array([(-1.6, 0.1), (0.0, 2.8), (-0.6, 1.4), (0.3, 1.8)])
BENT = np.array([0.0, 0.0, 0.0, np.pi / 2.0])


def test_the_arm_hangs_down_and_its_elbow_bends_forward():
    np.testing.assert_allclose(hands(np.zeros(4)), [0.0, 0.0, -UPPER - FORE], atol=1e-15)
    np.testing.assert_allclose(hands(BENT), [FORE, 0.0, -UPPER], atol=1e-15)
    np.testing.assert_allclose(hands(BENT + [-np.pi / 2.0, 0.0, 0.0, 0.0]), [UPPER, 0.0, FORE], atol=1e-15)
    np.testing.assert_allclose(hands(BENT + [0.0, np.pi / 2.0, 0.0, 0.0]), [FORE, UPPER, 0.0], atol=1e-15)


def test_a_reach_comes_to_where_a_pose_nearby_has_the_hand_and_no_farther_than_its_tether():
    start = np.array([-0.8, 1.2, 0.3, 1.0])
    assert missing(start, hands(start + [0.3, -0.2, 0.1, 0.2]), RANGES) < 0.002
    assert missing(start, np.array([0.0, 0.0, 1.0]), RANGES) > 1.0 - UPPER - FORE
    far = hands(start + [0.0, 3.0 * MAX_REACH, 0.0, 0.0])
    assert missing(start, far, RANGES) > 0.05


def test_a_target_on_the_path_is_swept_and_one_that_the_arm_leaves_is_not():
    start, end = BENT, BENT + [0.0, 1.0, 0.0, 0.0]
    half_way = hands((start + end) / 2.0)
    assert swept(start[None], end[None, None], half_way, 0.07).tolist() == [[True]]
    assert swept(start[None], end[None, None], np.array([0.0, -0.3, 0.0]), 0.07).tolist() == [[False]]
    assert swept(start[None], end[None, None], hands(start), 0.07).tolist() == [[False]]


def test_reaches_on_the_plant_bring_the_true_rewards_on_average():
    arm, target = ToyArm(3, start=40), grid()[13]
    arm.present(target)
    ends = {arm.reach(arm.space.part, MARKER).missing for _ in range(12 * STARTS)}
    assert len(ends) == STARTS
    assert np.mean([reward_of(end) for end in ends]) == pytest.approx(true_rewards(target.position)[40])


def test_a_planner_with_the_true_model_reaches_nearly_all_reachable_targets():
    problems = grid()[:9]
    best = sum(true_rewards(target.position).max() for target in problems)
    assert oracle(problems).evaluate(problems, 2).rewards.sum(axis=1).min() > 0.75 * best


def test_a_tenth_of_all_actions_is_blocked():
    exist = (toy_space().goals >= 0).sum()
    assert np.mean([blocked(target.position).sum() / exist for target in grid()]) == pytest.approx(0.11, abs=0.02)
