from __future__ import annotations

import numpy as np
import pytest

import mobee
from experiments.learning.outcomes import ends_of, exists_in, failure_shares, failures_of, goals_of, outcome_counts, tries_of, visits_of

SPACE = mobee.Lattice(mobee.load_robot("icub"), ["l_elbow", "l_shoulder_yaw"], neighbours="equidistant")  # 0 has the goals 1 and 3
SEEN = np.array([[0, 0, 1], [0, 0, 4], [0, 0, 1], [0, 1, 3], [4, 2, 5]])


def test_tries_goals_and_visits_are_counted():
    assert tries_of(SPACE, SEEN)[0].tolist() == [3, 1, 0, 0]
    assert tries_of(SPACE, SEEN).sum() == len(SEEN)
    assert goals_of(SPACE, SEEN).tolist() == [1, 1, 1, 3, 5]
    assert visits_of(SPACE, SEEN).tolist() == [0, 2, 0, 1, 1, 1, 0, 0, 0]


def test_records_of_small_unsigned_numbers_are_counted_alike():
    small = SEEN.astype(np.uint16)
    assert (tries_of(SPACE, small) == tries_of(SPACE, SEEN)).all() and (failures_of(SPACE, small) == failures_of(SPACE, SEEN)).all()
    assert failures_of(SPACE, SEEN)[0].tolist() == [1, 0, 0, 0]
    assert exists_in(SPACE).sum() == SPACE.state_actions


def test_a_failure_is_an_end_elsewhere_and_what_was_never_tried_has_no_share():
    shares = failure_shares(SPACE, SEEN)
    assert shares[0, :2] == pytest.approx([1 / 3, 0.0])
    assert np.isnan(shares[1]).all()


def test_ends_are_given_by_frequency():
    assert list(ends_of(SPACE, SEEN, 0, 1).items()) == [(1, 2), (4, 1)]
    assert ends_of(SPACE, SEEN, 5, 4) == {}


def test_outcomes_are_counted_once_each():
    assert outcome_counts(SPACE, SEEN)[0].tolist() == [2, 1, 0, 0]
