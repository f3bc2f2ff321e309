# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np

from mobee.learning.reaching.predictors.predictor import EXPECTED, KNOTS, DistancePrior, Reached, lengths
from tests.mobee.learning.reaching.predictors.arms import FAR, places, reaches


def test_without_reaches_the_same_is_expected_at_every_distance():
    prior = DistancePrior(reaches(), Reached())
    np.testing.assert_allclose(prior.mean(places()[0]), EXPECTED)
    np.testing.assert_allclose(prior.mean(FAR), EXPECTED)


def test_a_reward_that_falls_with_the_distance_is_found():
    made, rng, known = reaches(0, 40), np.random.default_rng(0), Reached()
    for _ in range(2000):
        state = int(rng.integers(40))
        target = made.hands[state] + rng.uniform(-0.25, 0.25, 3)
        known.add(state, target, max(0.0, 1.0 - 2.0 * float(np.linalg.norm(target - made.hands[state]))))
    prior, target = DistancePrior(made, known), np.array([0.1, 0.05, 0.0])
    np.testing.assert_allclose(prior.mean(target), 1.0 - 2.0 * np.linalg.norm(target - made.hands, axis=1), atol=0.02)


def test_several_targets_at_once_are_as_one_by_one():
    made = reaches()
    np.testing.assert_allclose(lengths(made, places()), np.stack([lengths(made, one) for one in places()], axis=1))
    assert KNOTS[0] == 0.0
