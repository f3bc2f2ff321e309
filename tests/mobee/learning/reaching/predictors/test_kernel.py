# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np

from mobee.learning.reaching.predictors.local_averages import JOINTS, PLACES, PRIOR_WEIGHT, Kernel
from mobee.learning.reaching.predictors.predictor import EXPECTED, Reached, around
from mobee.learning.reaching.predictors.predictor import IMAGINED as PAIRS
from tests.mobee.learning.reaching.predictors.arms import drawn, places, reaches, taught

TRIES = 22  # the scales were chosen just then


def weight(made, scales, one, other):
    scaled = made.samples / np.ptp(made.samples, axis=0)
    joints, place = ((scaled[one[0]] - scaled[other[0]]) ** 2).sum(), ((one[1] - other[1]) ** 2).sum()
    return np.exp(-0.5 * joints / scales[0] ** 2 - 0.5 * place / scales[1] ** 2)


def middle(seen):
    by_pair = {}
    for state, target, value in seen:
        by_pair.setdefault((state, target.tobytes()), []).append(value)
    rewards = [np.mean(values) for values in by_pair.values()]
    return (sum(rewards) + PAIRS * EXPECTED) / (len(rewards) + PAIRS)


def test_the_mean_is_the_sum_over_all_reaches_with_gaussian_weights():
    made, seen = reaches(), drawn(reaches(), TRIES)
    kernel = taught(Kernel(made), seen)
    for target in (places()[1], np.zeros(3)):
        for state in range(len(made)):
            weights = [weight(made, kernel.scales, (state, target), one) for one in seen]
            total = sum(w * (one[2] - middle(seen)) for w, one in zip(weights, seen, strict=True))
            np.testing.assert_allclose(kernel.mean(target)[state], middle(seen) + total / (sum(weights) + PRIOR_WEIGHT), rtol=1e-9)


def test_the_scales_are_those_that_predict_each_reach_best_from_all_others():
    made, seen = reaches(), drawn(reaches(), TRIES)
    errors = {}
    for scales in [(a, b) for b in PLACES for a in JOINTS]:
        total = 0.0
        for one in seen:
            like = [other[2] for other in seen if other[0] == one[0] and (other[1] == one[1]).all()]
            weights = np.array([weight(made, scales, one, other) for other in seen])
            itself = next(i for i, other in enumerate(seen) if other is one)
            values = np.array([np.mean(like) if weight(made, scales, one, other) == 1.0 else other[2] for other in seen])
            weights[itself] = 0.0
            foretold = weights @ (values - middle(seen)) / (weights.sum() + PRIOR_WEIGHT)
            total += (np.mean(like) - middle(seen) - foretold) ** 2
        errors[scales] = total
    assert taught(Kernel(made), seen).scales == min(errors, key=lambda scales: errors[scales])


def test_a_reach_like_one_seen_is_expected_to_bring_the_same():
    made = reaches()
    kernel = taught(Kernel(made), [(3, places()[0], 0.9)] * 50)
    assert abs(kernel.mean(places()[0])[3] - 0.9) < 0.01
    assert kernel.deviation(places()[0])[3] < 0.1 * kernel.deviation(places()[0] + 50.0)[3]


def test_with_a_prior_nearer_hands_are_expected_to_reach_better_where_nothing_was_tried():
    made, rng = reaches(0, 40), np.random.default_rng(0)
    seen = [(int(rng.integers(20)), target) for target in rng.uniform(-0.25, 0.25, (200, 3))]  # never from the other 20 states
    taken = [(state, target, float(np.exp(-10.0 * np.linalg.norm(target - made.hands[state])))) for state, target in seen]
    target = np.array([0.05, -0.02, 0.13])
    truth = np.exp(-10.0 * np.linalg.norm(target - made.hands, axis=1))
    errors = [np.abs(taught(Kernel(made, prior), taken).mean(target) - truth)[20:].mean() for prior in (False, True)]
    assert errors[1] < 0.5 * errors[0]


def test_around_begins_with_what_is_imagined():
    assert around(Reached()) == (EXPECTED, 0.25**2)
