from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import UnknownName
from mobee.learning.reaching.failures import FAILURES, Failures, failures_of, has_failed
from mobee.learning.reaching.predictors import Reaches
from tests.mobee.learning.reaching.toy import HANDS, SPACE

HERE, THERE = np.zeros(3), np.array([0.2, 0.0, 0.0])


def test_a_transition_fails_that_does_not_climb_the_values():
    values = np.array([0.5, 0.6, 0.5])
    assert [has_failed(values, 0, following) for following in range(3)] == [True, False, True]


def test_nothing_is_expected_to_fail_at_first():
    assert Failures(3, 4, 0.01).rewards(HERE).tolist() == np.zeros((3, 4)).tolist()


def test_a_lone_failure_tells_less_of_targets_far_away():
    failures = Failures(3, 4, 0.01)
    failures.add(2, 1, HERE, -10.0)
    assert failures.rewards(HERE)[2, 1] == pytest.approx(-5.0)
    assert failures.rewards(THERE)[2, 1] == pytest.approx(-10 / 21 / (22 / 21))
    assert np.count_nonzero(failures.rewards(THERE)) == 1


def test_successes_take_failures_back():
    failures = Failures(3, 4, 0.01)
    failures.add(0, 0, HERE, -10.0)
    for _ in range(8):
        failures.add(0, 0, HERE, 0.0)
    assert failures.rewards(HERE)[0, 0] == pytest.approx(-1.0)


def test_local_failures_say_nothing_of_other_targets():
    failures = Failures(3, 4, 0.01, "local")
    failures.add(2, 1, HERE, -10.0)
    assert failures.rewards(HERE)[2, 1] == pytest.approx(-5.0)
    assert failures.rewards(HERE + 0.01)[2, 1] < -2.5
    assert not failures.rewards(THERE).any()


def test_a_copy_goes_its_own_way():
    failures = Failures(3, 4, 0.01)
    failures.copy().add(1, 1, HERE, -10.0)
    assert not failures.rewards(HERE).any()


def test_an_unknown_kind_is_refused():
    with pytest.raises(UnknownName, match="local"):
        failures_of(SPACE, Reaches(SPACE.samples, HANDS), "locale")


@pytest.mark.parametrize("kind", FAILURES)
def test_every_kind_is_made_by_its_name_and_expects_no_failure_at_first(kind):
    failures = failures_of(SPACE, Reaches(SPACE.samples, HANDS), kind)
    assert failures.rewards(HERE).tolist() == np.zeros(SPACE.goals.shape).tolist()
