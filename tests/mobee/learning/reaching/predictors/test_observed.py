# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.learning.reaching.predictors.predictor import EXPECTED, SPREAD, Reached, around

HERE, THERE, NOWHERE = np.array([0.1, 0.2, 0.3]), np.array([0.1, 0.2, 0.4]), np.zeros(3)


def filled() -> tuple[Reached, list[int]]:
    known = Reached()
    return known, [known.add(*one) for one in ((4, HERE, 0.2), (5, HERE, 0.6), (4, THERE, 0.1), (4, HERE, 0.4))]


def test_repeats_of_a_state_and_a_target_are_one_pair():
    known, pairs = filled()
    assert pairs == [0, 1, 2, 0] and (len(known), known.tries) == (3, 4)
    assert known.state.tolist() == [4, 5, 4] and known.places[known.target].tolist() == [HERE.tolist(), HERE.tolist(), THERE.tolist()]
    assert known.count.tolist() == [2, 1, 1] and known.mean == pytest.approx([0.3, 0.6, 0.1])
    assert known.scatter == pytest.approx(2 * 0.1**2)


def test_what_was_never_reached_for_is_not_found():
    known, _ = filled()
    assert (known.find(THERE), known.find(NOWHERE)) == (1, None)
    assert (known.pair(4, THERE), known.pair(5, THERE), known.pair(4, NOWHERE)) == (2, None, None)


def test_any_number_of_pairs_and_targets_is_kept():
    known = Reached()
    for n in range(50):
        assert known.add(n % 7, np.array([n, 0.0, 0.0]), n / 50) == n
    assert known.mean == pytest.approx(np.arange(50) / 50) and known.places[:, 0].tolist() == list(range(50))


def test_the_average_of_all_rewards_begins_at_what_is_expected_and_follows_what_was_seen():
    known = Reached()
    assert around(known) == pytest.approx((EXPECTED, SPREAD**2))
    for n in range(400):
        known.add(n, HERE, 0.9 if n % 2 else 0.7)
    middle, variance = around(known)
    assert middle == pytest.approx(0.8, abs=0.01) and variance == pytest.approx(0.01, abs=0.005)
