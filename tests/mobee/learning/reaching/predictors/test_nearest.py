# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np

from mobee.learning.reaching.predictors.local_averages import AVERAGE_WEIGHT, HALF_WEIGHT, JOINT_WEIGHT, LENGTH_SCALE, NEIGHBOURS, Nearest
from mobee.learning.reaching.predictors.predictor import Reached, around
from tests.mobee.learning.reaching.predictors.arms import drawn, places, reaches, taught


def test_the_mean_is_that_of_the_five_nearest_of_all_pairs():
    made, seen = reaches(), drawn(reaches(), 80)
    nearest, known = taught(Nearest(made), seen), Reached()
    for state, target, value in seen:
        known.add(state, target, value)
    scaled, middle = made.samples / np.ptp(made.samples, axis=0) * JOINT_WEIGHT, around(known)[0]
    for target in (places()[0], np.array([0.1, 0.0, -0.05])):
        for state in range(len(made)):
            pairs = []
            for other, place, reward in zip(known.state, known.target, known.mean, strict=True):
                way = (target - made.hands[state]) - (known.places[place] - made.hands[other])
                pairs.append((((scaled[state] - scaled[other]) ** 2).sum() + way @ way / LENGTH_SCALE**2, reward))
            best = sorted(pairs)[:NEIGHBOURS]
            weights = [1.0 / (far + HALF_WEIGHT) for far, _ in best]
            total = AVERAGE_WEIGHT * middle + sum(w * reward for w, (_, reward) in zip(weights, best, strict=True))
            np.testing.assert_allclose(nearest.mean(target)[state], total / (AVERAGE_WEIGHT + sum(weights)), rtol=1e-9)


def test_neighbours_of_a_target_are_the_same_with_and_without_earlier_queries():
    made, seen, target = reaches(), drawn(reaches(), 60), np.array([0.02, 0.1, -0.1])
    asked = Nearest(made)
    for state, place, value in seen:
        asked.add(state, place, value, 0.0)
        asked.mean(target)
    np.testing.assert_array_equal(asked.mean(target), taught(Nearest(made), seen).mean(target))
