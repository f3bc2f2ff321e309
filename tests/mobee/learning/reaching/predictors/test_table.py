# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np

from mobee.learning.reaching.predictors.local_averages import TABLE_NOISE, Table
from mobee.learning.reaching.predictors.predictor import EXPECTED, IMAGINED, SPREAD
from tests.mobee.learning.reaching.predictors.arms import places, reaches, taught


def test_the_posterior_of_a_pair_is_that_of_a_normal_mean():
    table = taught(Table(reaches()), [(2, places()[0], 0.8), (2, places()[0], 0.6)])
    middle = (0.7 + IMAGINED * EXPECTED) / (1.0 + IMAGINED)
    spread = ((0.7 - middle) ** 2 + IMAGINED * SPREAD**2) / (1.0 + IMAGINED)
    noise = (0.02 + IMAGINED * TABLE_NOISE**2) / (1.0 + IMAGINED)
    precision = 1.0 / spread + 2.0 / noise
    assert np.isclose(table.mean(places()[0])[2], (middle / spread + 1.4 / noise) / precision)
    assert np.isclose(table.deviation(places()[0])[2], precision**-0.5)


def test_nothing_is_learned_for_another_state_or_target():
    table = taught(Table(reaches()), [(2, places()[0], 0.9)] * 5)
    untried = table.mean(places()[1])[0]
    assert np.delete(table.mean(places()[0]), 2).tolist() == [untried] * 11
    assert table.mean(places()[1]).tolist() == [untried] * 12
