# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.learning.reaching.predictors.networks import Networks, layers, slopes
from tests.mobee.learning.reaching.predictors.arms import drawn, places, reaches, taught


def test_the_slopes_are_the_derivatives_of_the_error():
    rng = np.random.default_rng(0)
    weights = [rng.normal(size=(2, *size)) for size in ((3, 4), (4, 4), (4, 1))]
    biases = [rng.normal(size=(2, 1, size)) for size in (4, 4, 1)]
    inputs, rewards, copies = rng.normal(size=(2, 6, 3)), rng.random((2, 6)), rng.poisson(1.0, (2, 6))

    def error():
        said = layers(weights, biases, inputs)[-1][..., 0]
        return 0.5 * (copies * (said - rewards) ** 2).sum() / 6

    for values, slope in zip((*weights, *biases), slopes(weights, biases, inputs, rewards, copies), strict=True):
        for index in [tuple(rng.integers(values.shape)) for _ in range(4)]:
            kept, found = values[index], []
            for sign in (1.0, -1.0):
                values[index] = kept + sign * 1e-6
                found.append(error())
            values[index] = kept
            assert slope[index] == pytest.approx((found[0] - found[1]) / 2e-6, rel=1e-5, abs=1e-9)


def test_another_seed_makes_other_networks():
    made, seen = reaches(), drawn(reaches(), 20)
    one, same, other = (taught(Networks(made, seed), seen).mean(places()[0]) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 1e-3
