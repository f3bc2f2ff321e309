# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import InvalidValue
from mobee.learning.reaching.predictors import PREDICTORS, Reaches
from mobee.learning.reaching.predictors.local_averages import Table
from mobee.learning.reaching.strategies import OPTIMISM, RANDOM_SHARE, STRATEGIES, WINDOW, Progress

REACHES = Reaches(np.zeros((4, 2)), np.zeros((4, 3)))


HERE, THERE = np.zeros(3), np.array([0.03, 0.0, 0.0])


class Sure:
    """Predicts fixed numbers."""

    settings: dict = {}

    def add(self, state, target, reward, expected):
        pass

    def mean(self, target):
        return np.array([0.1, 0.2, 0.3, 0.4])

    def deviation(self, target):
        return np.array([0.4, 0.3, 0.2, 0.1])

    def sample(self, target, rng):
        return rng.normal(self.mean(target), self.deviation(target))


def made(name, predictor=None):
    return STRATEGIES[name](REACHES, Sure() if predictor is None else predictor)


def test_random_wants_one_state_and_all_equally_often():
    strategy, rng = made("random"), np.random.default_rng(0)
    drawn = [strategy.rewards(HERE, rng) for _ in range(400)]
    assert {tuple(sorted(worth)) for worth in drawn} == {(0.0, 0.0, 0.0, 1.0)}
    assert np.sum(drawn, axis=0) == pytest.approx([100] * 4, abs=35)


def test_greedy_returns_the_expected_rewards():
    assert made("greedy").rewards(HERE, np.random.default_rng(0)).tolist() == [0.1, 0.2, 0.3, 0.4]


def test_intrinsic_wants_the_errors_expected_signed_as_printed():
    strategy = made("intrinsic")
    assert strategy.rewards(HERE, np.random.default_rng(0)).tolist() == [1.0] * 4
    strategy.add(1, HERE, reward=0.2, expected=1.0)
    strategy.add(1, THERE, reward=0.9, expected=0.5)
    assert strategy.rewards(HERE, np.random.default_rng(0)) == pytest.approx([1.0, (1 + 0.8 - 0.25 * 0.4) / 2.25, 1.0, 1.0])


def test_ucb_hopes_for_two_deviations():
    assert made("ucb").rewards(HERE, np.random.default_rng(0)) == pytest.approx(
        np.array([0.1, 0.2, 0.3, 0.4]) + OPTIMISM * np.array([0.4, 0.3, 0.2, 0.1])
    )


def test_thompson_wants_one_draw():
    first, second = (made("thompson").rewards(HERE, np.random.default_rng(seed)).tolist() for seed in (0, 0))
    assert first == second == Sure().sample(HERE, np.random.default_rng(0)).tolist()


@pytest.mark.parametrize("name", ["ucb", "thompson"])
def test_the_published_predictor_is_not_for_strategies_that_need_to_know_how_sure_it_is(name):
    with pytest.raises(InvalidValue, match="intrinsic, greedy or random"):
        made(name, PREDICTORS["weighted"](REACHES)).rewards(HERE, np.random.default_rng(0))


MADE = Reaches(np.zeros((3, 2)) + np.arange(3)[:, None], np.zeros((3, 3)))


STEADY = next(seed for seed in range(100) if np.random.default_rng(seed).random() >= RANDOM_SHARE)


SPOT = np.zeros(3)


def progress_of(*rewards: float) -> Progress:
    """After reaches from state 0."""
    progress = Progress(MADE, Table(MADE))
    for reward in rewards:
        progress.add(0, SPOT, reward, 0.0)
    return progress


def interest(progress: Progress) -> list[float]:
    return progress.rewards(SPOT, np.random.default_rng(STEADY)).tolist()


def test_states_tried_less_than_twice_are_worth_most():
    assert interest(progress_of(0.3)) == [1.0, 1.0, 1.0]
    assert interest(progress_of(0.3, 0.3)) == [0.0, 1.0, 1.0]


def test_interest_is_the_change_over_the_window_up_or_down_and_older_reaches_are_forgotten():
    rising = [0.9] * 5 + [0.1] * (WINDOW // 2) + [0.5] * (WINDOW // 2)
    assert np.isclose(interest(progress_of(*rising))[0], 0.4)
    assert np.isclose(interest(progress_of(*rising[::-1][:WINDOW]))[0], 0.4)


def test_an_odd_number_of_reaches_leaves_the_middle_one_out():
    assert np.isclose(interest(progress_of(0.2, 0.9, 0.3))[0], 0.1)


def test_some_tries_reach_from_a_state_drawn_at_random():
    progress = progress_of(0.1, 0.4)
    drawn = [progress.rewards(SPOT, np.random.default_rng(seed)).tolist() for seed in range(500)]
    single = [one for one in drawn if sorted(one) == [0.0, 0.0, 1.0]]
    assert abs(len(single) / 500 - RANDOM_SHARE) < 0.06
    assert {one.index(1.0) for one in single} == {0, 1, 2}


def test_writing_into_returned_arrays_changes_nothing():
    progress = progress_of(0.1, 0.4)
    progress.rewards(SPOT, np.random.default_rng(STEADY))[:] = 5.0
    assert np.isclose(interest(progress)[0], 0.3)
