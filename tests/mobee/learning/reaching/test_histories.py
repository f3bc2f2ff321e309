# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.errors import InvalidValue
from mobee.learning.reaching.histories import Histories, forget, grown

ORIGIN = np.zeros(3)


def at(x: float) -> np.ndarray:
    return np.array([x, 0.0, 0.0])


def plain(history, target, scale, prior):
    """Thesis eqs. 8.1, 8.5 and 8.7 as loops, (target, value) by (target, value)."""
    total, weight = prior, 1.0
    for where, value in history:
        near = 1.0 / (1.0 + np.linalg.norm(target - where) / scale)
        total, weight = total + near * value, weight + near
    return total / weight


def test_without_history_the_prior_is_expected():
    assert Histories(2, 0.01).average(ORIGIN, 1.0).tolist() == [1.0, 1.0]
    assert Histories(2, 0.01).average(ORIGIN, 0.0).tolist() == [0.0, 0.0]


def test_hand_computed_averages_in_centimetres():
    histories = Histories(3, 0.01)
    histories.add(0, at(0.0), 0.2)  # weight 1
    histories.add(0, at(0.03), 0.6)  # weight 1/4
    histories.add(2, at(0.09), -10.0)  # weight 1/10
    assert histories.average(ORIGIN, 1.0) == pytest.approx([(1 + 0.2 + 0.15) / 2.25, 1.0, (1 - 1) / 1.1])
    assert histories.average(ORIGIN, 0.0) == pytest.approx([0.35 / 2.25, 0.0, -1 / 1.1])


def test_in_metres_every_target_counts_nearly_the_same():
    histories = Histories(1, 1.0)
    histories.add(0, at(0.25), 0.5)
    assert histories.average(ORIGIN, 1.0) == pytest.approx([(1 + 0.8 * 0.5) / 1.8])


def test_beyond_near_nothing_counts():
    histories = Histories(2, 0.01, near=0.025)
    histories.add(0, at(0.02), -10.0)
    histories.add(1, at(0.03), -10.0)
    assert histories.average(ORIGIN, 0.0) == pytest.approx([-10 / 3 / (4 / 3), 0.0])


places = st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3).map(np.array)


entries = st.lists(st.tuples(st.integers(0, 3), st.integers(0, 4), st.floats(-10.0, 1.0)), max_size=40)


@given(st.lists(places, min_size=5, max_size=5), entries, places, st.floats(1e-3, 1.0), st.sampled_from([0.0, 1.0]))
def test_averages_are_those_of_plain_loops(targets, made, target, scale, prior):
    histories = Histories(4, scale)
    for action, place, value in made:
        histories.add(action, targets[place], value)
    expected = [plain([(targets[place], value) for a, place, value in made if a == action], target, scale, prior) for action in range(4)]
    assert histories.average(target, prior) == pytest.approx(expected, abs=1e-9)


def test_a_copy_is_independent():
    histories = Histories(2, 0.01)
    histories.add(0, ORIGIN, 0.5)
    other = histories.copy()
    for n in range(20):
        other.add(1, at(0.01 * n), 1.0)
    other.add(0, ORIGIN, 0.1)
    histories.add(1, at(0.5), 0.25)
    assert histories.average(ORIGIN, 0.0) == pytest.approx([0.25, 0.25 / 51 / (52 / 51)])
    assert other.average(ORIGIN, 0.0)[0] == pytest.approx(0.2)


def test_actions_that_there_are_not_are_refused():
    for action in (-1, 2):
        with pytest.raises(InvalidValue, match="valid are 0 to 1"):
            Histories(2, 0.01).add(action, ORIGIN, 1.0)


def test_an_array_that_is_long_enough_is_kept_and_another_grows_twice_as_long():
    array = np.arange(4.0)
    assert grown(array, 3) is array
    longer = grown(array, 4)
    assert longer.tolist() == [0.0, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.0]
    assert grown(np.zeros((2, 3), dtype=int), 2).shape == (4, 3)


@pytest.mark.parametrize(("most", "left"), [(4, "abc"), (3, "bc"), (1, "")])
def test_the_oldest_entries_are_deleted_until_one_more_fits(most, left):
    found = {letter.encode(): 0 for letter in "abc"}
    forget(found, most)
    assert list(found) == [letter.encode() for letter in left]
