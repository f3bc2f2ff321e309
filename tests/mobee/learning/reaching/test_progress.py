from __future__ import annotations

import numpy as np

from mobee.learning.reaching.predictors import Reaches
from mobee.learning.reaching.predictors.table import Table
from mobee.learning.reaching.strategies import AT_RANDOM, WINDOW, Progress

MADE = Reaches(np.zeros((3, 2)) + np.arange(3)[:, None], np.zeros((3, 3)))
STEADY = next(seed for seed in range(100) if np.random.default_rng(seed).random() >= AT_RANDOM)
HERE = np.zeros(3)


def made(*rewards: float) -> Progress:
    """After reaches from state 0."""
    progress = Progress(MADE, Table(MADE))
    for reward in rewards:
        progress.add(0, HERE, reward, 0.0)
    return progress


def interest(progress: Progress) -> list[float]:
    return progress.rewards(HERE, np.random.default_rng(STEADY)).tolist()


def test_states_tried_less_than_twice_are_worth_most():
    assert interest(made(0.3)) == [1.0, 1.0, 1.0]
    assert interest(made(0.3, 0.3)) == [0.0, 1.0, 1.0]


def test_interest_is_the_change_over_the_window_up_or_down_and_older_reaches_are_forgotten():
    rising = [0.9] * 5 + [0.1] * (WINDOW // 2) + [0.5] * (WINDOW // 2)
    assert np.isclose(interest(made(*rising))[0], 0.4)
    assert np.isclose(interest(made(*rising[::-1][:WINDOW]))[0], 0.4)


def test_an_odd_number_of_reaches_leaves_the_middle_one_out():
    assert np.isclose(interest(made(0.2, 0.9, 0.3))[0], 0.1)


def test_some_tries_reach_from_a_state_drawn_at_random():
    progress = made(0.1, 0.4)
    drawn = [progress.rewards(HERE, np.random.default_rng(seed)).tolist() for seed in range(500)]
    single = [one for one in drawn if sorted(one) == [0.0, 0.0, 1.0]]
    assert abs(len(single) / 500 - AT_RANDOM) < 0.06
    assert {one.index(1.0) for one in single} == {0, 1, 2}


def test_writing_into_what_was_told_changes_nothing():
    progress = made(0.1, 0.4)
    progress.rewards(HERE, np.random.default_rng(STEADY))[:] = 5.0
    assert np.isclose(interest(progress)[0], 0.3)
