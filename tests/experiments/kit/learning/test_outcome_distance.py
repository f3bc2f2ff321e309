# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.kit.learning.live import JOINTS, counts_of, distance, variations
from mobee import Lattice, load_robot


@pytest.fixture(scope="module")
def space():
    return Lattice(load_robot("icub"), JOINTS["left_arm"], neighbours=8)


def test_counts_say_how_often_each_outcome_was_seen(space):
    counts = counts_of(np.array([(0, 1, 5), (0, 1, 5), (0, 1, 6), (3, 2, 3)]), space)
    assert counts.shape == (81, 8, 81) and counts.sum() == 4
    assert (counts[0, 1, 5], counts[0, 1, 6], counts[3, 2, 3]) == (2, 1, 1)
    assert counts_of(np.zeros((0, 3)), space).sum() == 0


def test_total_variation_is_half_the_distance_of_the_shares(space):
    first = counts_of(np.array([(0, 0, 5)] * 3 + [(0, 0, 6)] + [(1, 0, 7)] * 4), space)
    second = counts_of(np.array([(0, 0, 5)] * 2 + [(0, 0, 9)] * 2 + [(1, 0, 7)] * 9), space)
    apart = variations(first, second, 4)
    assert apart[0, 0] == pytest.approx(0.5) and apart[1, 0] == 0.0
    assert np.isfinite(apart).sum() == 2 and np.isfinite(variations(first, second, 5)).sum() == 0
    assert np.array_equal(apart, variations(second, first, 4), equal_nan=True)


def test_the_distance_is_taken_over_the_actions_of_all_parts(space):
    first = {"a": counts_of(np.array([(0, 0, 5)] * 3), space), "b": counts_of(np.array([(0, 0, 5)] * 3), space)}
    second = {"a": counts_of(np.array([(0, 0, 5)] * 3), space), "b": counts_of(np.array([(0, 0, 6)] * 3), space)}
    found = distance(first, second, 3)
    assert (found.variation, found.agree, found.compared) == (0.5, 0.5, 2)
    assert distance(first, second, 4).compared == 0
