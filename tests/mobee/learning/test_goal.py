# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json
from fractions import Fraction

import numpy as np
import pytest

from mobee.errors import InvalidValue, MobeeError
from mobee.learning.agent import CuriousAgent
from mobee.learning.goal import External, target_states
from mobee.store import TransitionStore
from tests.mobee.learning.toys import InstantPlant, arm, torso, toy_robot

SPACE = arm(neighbours="equidistant")
EXISTS = SPACE.goals >= 0


def test_target_states_an_array_and_a_function_say_the_same():
    by_states = External(SPACE, [80, 3])
    array = np.zeros(SPACE.goals.shape)
    array[[3, 80]] = 1.0
    by_function = External(SPACE, lambda state, action, goal: float(state in (3, 80)))
    for other in (External(SPACE, array), by_function, External(SPACE, np.array([3, 80]))):
        assert np.array_equal(other.reward, by_states.reward)
        assert other.settings == by_states.settings
    assert np.array_equal(by_states.reward == -np.inf, ~EXISTS)


def test_a_function_sees_state_action_and_goal():
    external = External(SPACE, lambda state, action, goal: state + 100.0 * goal + action / 10)
    assert external.reward[7, 2] == pytest.approx(7 + 100 * SPACE.goal(7, 2) + 0.2)


def test_an_external_reward_replaces_the_intrinsic_one_or_is_added_to_it():
    intrinsic = np.where(EXISTS, 0.5, -np.inf)
    assert np.array_equal(External(SPACE, [3]).combined(intrinsic), External(SPACE, [3]).reward)
    added = External(SPACE, [3], weight=0.1).combined(intrinsic)
    assert added[3, 0] == pytest.approx(0.6) and added[4, 0] == 0.5
    assert np.array_equal(added == -np.inf, ~EXISTS)


@pytest.mark.parametrize("weight", [np.float32(0.5), np.int64(1), Fraction(1, 2)])
def test_a_weight_may_be_any_real_number_and_is_recorded_as_a_float(weight):
    external = External(SPACE, [3], weight)
    assert external.combined(np.where(EXISTS, 0.5, -np.inf)).dtype == np.float64
    assert json.loads(json.dumps(external.settings))["weight"] == float(weight)


def test_an_agent_with_a_goal_goes_there_and_stays_near():
    agent = CuriousAgent(SPACE, InstantPlant(SPACE.robot), goal=[80])
    agent.run(40)
    assert np.flatnonzero(np.array([agent.state]) == 80).size or 80 in SPACE.actions(agent.state)
    assert agent.model.tries[80].sum() >= 16  # every second action begins there


def test_a_goal_added_to_curiosity_draws_it_there_more_often_than_curiosity_alone():
    visits = {}
    for weight in (None, 0.1):
        options = {} if weight is None else {"goal": [80], "goal_weight": weight}
        agent = CuriousAgent(SPACE, InstantPlant(SPACE.robot), **options)
        agent.run(300)
        visits[weight] = int(agent.model.tries[80].sum()), int((agent.model.tries > 0).sum())
    assert visits[0.1][0] >= 2 * visits[None][0]
    assert visits[0.1][1] > 250  # and it still explores


def test_a_goal_is_among_the_settings_on_record(tmp_path):
    def make(**options):
        return CuriousAgent(torso(), InstantPlant(toy_robot()), store=TransitionStore(tmp_path / "run.sqlite", "torso"), **options)

    make(goal=[3]).run(2)
    make(goal=[3])
    for other in ({}, {"goal": [4]}, {"goal": [3], "goal_weight": 2.0}):
        with pytest.raises(MobeeError, match="torso has goal = .* on record"):
            make(**other)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"goal": [81]}, "no such state. Valid are 0 to 80"),
        ({"goal": []}, "no such state"),
        ({"goal": [0.5]}, "no such state"),
        ({"goal": np.zeros((3, 3))}, r"shape \(3, 3\).*shape \(81, 8\)"),
        ({"goal": np.full((81, 8), np.nan)}, "not finite"),
        ({"goal": [3], "goal_weight": np.inf}, "goal_weight=inf"),
        ({"goal": [3], "goal_weight": "much"}, "goal_weight=.much."),
        ({"goal_weight": 1.0}, "without a goal"),
        ({"goal": [3], "explorer": "random"}, "'random' ignores a goal: take 'curious'"),
    ],
)
def test_a_goal_that_cannot_be_pursued_is_refused(options, message):
    with pytest.raises(InvalidValue, match=message):
        CuriousAgent(SPACE, InstantPlant(SPACE.robot), **options)


def test_target_states_are_ascending_and_each_once():
    assert target_states(SPACE, [5, 3, 5]).tolist() == [3, 5]
    assert target_states(SPACE, 7).tolist() == [7]
