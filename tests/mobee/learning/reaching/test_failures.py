# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee.errors import UnknownName
from mobee.learning.reaching.failures import (
    FAILURES,
    JOINT_SCALE,
    LENGTH_SCALE,
    MAX_COST,
    PRIOR_WEIGHT,
    AlikeFailures,
    Failures,
    failures_of,
    has_failed,
)
from mobee.learning.reaching.predictors import Reaches
from tests.mobee.learning.reaching.toy import HANDS, SPACE

HERE, THERE = np.zeros(3), np.array([0.2, 0.0, 0.0])


def test_a_transition_fails_that_does_not_climb_the_values():
    values = np.array([0.5, 0.6, 0.5])
    assert [has_failed(values, 0, following) for following in range(3)] == [True, False, True]


def test_nothing_is_expected_to_fail_at_first():
    assert Failures(3, 4, 0.01).rewards(HERE).tolist() == np.zeros((3, 4)).tolist()


def test_a_single_failure_counts_less_for_distant_targets():
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


def test_a_copy_is_independent():
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


ORIGIN, BESIDE = np.array([-0.25, 0.2, 0.2]), np.array([5.0, 5.0, 5.0])


REACHES = Reaches(SPACE.samples, HANDS)


def transitions(seed: int, count: int, targets: int = 3) -> list[tuple[int, int, np.ndarray, float]]:
    """State, action, target, reward."""
    rng = np.random.default_rng(seed)
    places = ORIGIN + rng.uniform(-0.1, 0.1, (targets, 3))
    return [
        (int(rng.integers(81)), int(rng.integers(16)), places[rng.integers(targets)], -10.0 * float(rng.random() < 0.3))
        for _ in range(count)
    ]


def taught(seen) -> AlikeFailures:
    failures = AlikeFailures(SPACE, REACHES)
    for one in seen:
        failures.add(*one)
    return failures


def middle(state: int, action: int) -> tuple[np.ndarray, np.ndarray]:
    goal = SPACE.goals[state, action]
    scaled = SPACE.samples / np.ptp(SPACE.samples, axis=0)
    return (HANDS[state] + HANDS[goal]) / 2.0, (scaled[state] + scaled[goal]) / 2.0


@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_what_was_not_tried_on_a_target_is_worth_what_all_others_say_in_a_plain_loop(seed):
    seen, target = transitions(seed, 12), ORIGIN + 0.03
    found, usual = taught(seen).rewards(target), sum(reward < 0.0 for *_, reward in seen) / 13.0
    for state, action in [(seen[0][0], seen[0][1]), (3, 2), (40, 15)]:
        hand, joints = middle(state, action)
        failed, weight = PRIOR_WEIGHT * usual, PRIOR_WEIGHT
        for other, way, place, reward in seen:
            its_hand, its_joints = middle(other, way)
            far = (((target - hand) - (place - its_hand)) ** 2).sum() / LENGTH_SCALE**2 + (
                (joints - its_joints) ** 2
            ).sum() / JOINT_SCALE**2
            failed += np.exp(-0.5 * far) * (reward < 0.0)
            weight += np.exp(-0.5 * far)
        expected = -MAX_COST * max(failed / weight - usual, 0.0) / (1.0 - usual)
        assert found[state, action] == pytest.approx(expected, abs=1e-5)


def test_what_was_tried_on_a_target_is_worth_the_average_of_its_rewards_and_a_0():
    failures = taught([(5, 2, ORIGIN, -10.0), (5, 2, ORIGIN, -10.0), (5, 2, ORIGIN, 0.0), (6, 1, ORIGIN, 0.0)])
    assert failures.rewards(ORIGIN)[5, 2] == pytest.approx(-5.0)
    assert failures.rewards(ORIGIN)[6, 1] == 0.0


def test_a_failure_counts_for_the_opposite_transition_and_not_for_distant_targets():
    goal = int(SPACE.goals[5, 2])
    back = SPACE.actions(goal).tolist().index(5) if 5 in SPACE.actions(goal) else None
    assert back is not None
    failures = taught([(5, 2, ORIGIN, -10.0)] * 5 + [(70, 3, BESIDE, 0.0)] * 20)
    assert -MAX_COST < failures.rewards(ORIGIN)[goal, back] < -0.2 * MAX_COST
    assert -MAX_COST < failures.rewards(ORIGIN + 0.005)[5, 2] < -0.2 * MAX_COST
    np.testing.assert_allclose(failures.rewards(ORIGIN + 1.0), 0.0, atol=1e-12)


def test_asking_in_between_changes_nothing():
    seen, asked = transitions(1, 60), AlikeFailures(SPACE, REACHES)
    for number, one in enumerate(seen):
        asked.add(*one)
        if number % 3 == 0:
            asked.rewards(one[2])
            asked.rewards(ORIGIN)
    for target in (seen[0][2], ORIGIN):
        np.testing.assert_array_equal(asked.rewards(target), taught(seen).rewards(target))


def test_a_copy_and_its_original_are_independent():
    seen = transitions(2, 64)  # as many as there is room for at first
    failures = taught(seen)
    before = failures.rewards(ORIGIN)
    copy = failures.copy()
    copy.add(0, 0, ORIGIN, -10.0)
    failures.add(7, 1, ORIGIN, -10.0)
    assert copy.rewards(ORIGIN)[0, 0] < before[0, 0] - 1.0
    assert copy.rewards(ORIGIN)[7, 1] > -1.0
    np.testing.assert_array_equal(failures.rewards(ORIGIN), taught([*seen, (7, 1, ORIGIN, -10.0)]).rewards(ORIGIN))
