# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee.learning.reaching.reaches import ReachPlanning
from mobee.learning.tabular import TabularPlant, half_space, ideal
from mobee.learning.transitions import TransitionModel
from tests.mobee.learning.toys import arm
from tests.mobee.learning.worlds import space_of

ROW = space_of([[1, -1], [0, 2], [1, 3], [2, -1]])  # a corridor of four states


def corridor(discount=0.9) -> ReachPlanning:
    return ReachPlanning(ROW, TabularPlant(ROW, *ideal(ROW)), discount)


def test_a_reach_ends_the_plan():
    values, action_values = corridor().values(np.array([0.0, 0.0, 0.0, 1.0]), 0.0)
    assert values == pytest.approx([0.729, 0.81, 0.9, 1.0])
    assert action_values[3] == pytest.approx([0.81, -np.inf, 1.0])


def test_a_reach_nearby_is_worth_more_than_a_better_one_far_away():
    values, action_values = corridor().values(np.array([0.8, 0.0, 0.0, 1.0]), 0.0)
    assert values == pytest.approx([0.8, 0.81, 0.9, 1.0])
    assert action_values.argmax(axis=1).tolist() == [2, 1, 1, 2]


def test_a_failed_transition_is_gone_around_or_not_taken():
    failed = np.zeros((4, 2))
    failed[1, 1] = -5.0
    values, action_values = corridor().values(np.array([0.3, 0.0, 0.0, 1.0]), failed)
    assert values == pytest.approx([0.3, 0.27, 0.9, 1.0])
    assert action_values[1] == pytest.approx([0.27, 0.81 - 5.0, 0.0])


def test_the_plan_continues_in_states_where_reaching_is_excluded():
    values, _ = corridor().values(np.array([-np.inf, -np.inf, 1.0, -np.inf]), 0.0)
    assert values == pytest.approx([0.81, 0.9, 1.0, 0.9])


def test_refresh_copies_the_beliefs():
    model = TransitionModel(ROW)
    planning = ReachPlanning(ROW, model.debiased(), 0.9)
    worth = np.array([0.0, 1.0, 0.0, 0.0])
    before = planning.values(worth, 0.0)[0][0]
    for _ in range(3):
        model.observe(0, 0, 3)  # the action to 1 leads to 3, which makes one more bin
    assert planning.values(worth, 0.0)[0][0] == before
    planning.refresh()
    share = np.array([0.1, 0.3, 3.0]) / 3.4
    values, action_values = planning.values(worth, 0.0)
    assert action_values[0, 0] == pytest.approx(0.9 * share @ values[[0, 1, 3]], abs=1e-6)


@settings(max_examples=25)
@given(st.integers(0, 1000), st.sampled_from([0.0, 0.5, 0.9, 0.99]))
def test_values_satisfy_the_bellman_equation(seed, discount):
    space = arm(neighbours="equidistant")
    outcomes, probabilities = half_space(space)
    rng = np.random.default_rng(seed)
    reaches, moves = rng.uniform(-0.2, 1.0, 81), np.where(rng.random(space.goals.shape) < 0.3, -10.0 * rng.random(space.goals.shape), 0.0)
    values, action_values = ReachPlanning(space, TabularPlant(space, outcomes, probabilities), discount).values(reaches, moves)
    expected = np.where(space.goals >= 0, moves + discount * (probabilities * values[outcomes]).sum(axis=2), -np.inf)
    assert action_values[:, -1].tolist() == reaches.tolist()
    assert action_values[:, :-1] == pytest.approx(expected, abs=1e-4)
    assert values == pytest.approx(np.maximum(expected.max(axis=1), reaches), abs=1e-4)
