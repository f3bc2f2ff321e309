# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mobee.learning.reaching.predictors.covariance import COMPLIANCES, LinearArm
from mobee.learning.reaching.predictors.predictor import Reached
from tests.mobee.learning.reaching.predictors.arms import places, reaches

ALL = np.arange(12)


def jointed():
    rng = np.random.default_rng(4)
    return replace(reaches(), jacobians=rng.uniform(-0.3, 0.3, (12, 3, 4)))


def test_what_is_left_is_where_springs_and_pull_are_in_balance():
    made, way = jointed(), places()[0] - reaches().hands
    arm = LinearArm(made, 40.0)
    for state in ALL:
        turned = np.zeros(4)
        for _ in range(5000):  # the joints follow the pull, until their springs hold it
            remaining = way[state] - made.jacobians[state] @ turned
            turned += 0.01 * (40.0 * made.jacobians[state].T @ remaining - turned)
        assert arm.remaining(np.array([state]), way[[state]]) == pytest.approx([np.linalg.norm(remaining)], rel=1e-6)


def test_nothing_gives_where_nothing_is_known_of_the_joints():
    made, way = reaches(), places()[0] - reaches().hands
    np.testing.assert_allclose(LinearArm(made, 160.0).remaining(ALL, way), np.linalg.norm(way, axis=1))


@pytest.mark.parametrize("give", [5.0, 80.0])
def test_how_far_the_joints_give_and_the_line_are_found_from_rewards(give):
    made, known = jointed(), Reached()
    true = LinearArm(made, give, 0.1, 0.7)
    for target in places():
        for state, value in enumerate(true.rewards(ALL, target)):
            known.add(state, target, value)
    found = LinearArm(made).fitted(known)
    assert found.compliance == give
    assert found.rewards(ALL, places()[1]) == pytest.approx(true.rewards(ALL, places()[1]), abs=0.02)


def test_where_less_is_got_the_nearer_the_hand_the_same_is_expected_everywhere():
    made, known = jointed(), Reached()
    for state, nearer in enumerate(LinearArm(made).rewards(ALL, places()[0])):
        known.add(state, places()[0], 0.8 - nearer)
    found = LinearArm(made).fitted(known)
    np.testing.assert_allclose(found.rewards(ALL, places()[1]), known.mean.mean())


def test_one_reach_is_enough_for_a_fit():
    known = Reached()
    known.add(0, places()[0], 0.4)
    found = LinearArm(jointed()).fitted(known)
    assert found.compliance in COMPLIANCES
    assert np.isfinite(found.rewards(ALL, places()[0])).all()
