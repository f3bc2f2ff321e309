# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import InvalidValue
from mobee.learning.agent import CuriousAgent
from mobee.learning.discrete import DiscreteSpace
from mobee.learning.tabular import TabularPlant, deep_sea, river_swim
from tests.mobee.learning import worlds


def test_a_state_is_its_number_and_no_change_is_expected():
    space = DiscreteSpace(5, 3)
    assert len(space) == 5 and space.state_actions == 15
    assert [space.state_of(space.target(state)) for state in range(5)] == list(range(5))
    assert space.state_of([3.0, 2.0]) == 3  # as a plant measures: the second motor is no part of the state
    assert space.goals.tolist() == [[state] * 3 for state in range(5)]
    assert [space.action_of(space.aim(4, action)) for action in range(3)] == [0, 1, 2]
    assert space.settings == DiscreteSpace(5, 3).settings != DiscreteSpace(5, 3, goals=np.zeros((5, 3))).settings


def test_actions_with_the_same_expectation_have_their_own_outcomes():
    world = river_swim(6)
    plant = TabularPlant(DiscreteSpace(6, 2), world.outcomes, world.probabilities, seed=2)
    twin = worlds.river_swim(6, seed=2)
    for action in np.random.default_rng(0).integers(2, size=300).tolist():
        assert plant.state == twin.state
        plant.act("environment", plant.space.aim(plant.state, action))
        twin.act("left_arm", twin.space.aim(twin.state, action))


def test_curiosity_needs_no_expectation_to_dive():
    sea = deep_sea(8)
    plant = TabularPlant(DiscreteSpace(36, 2), sea.outcomes, sea.probabilities)
    agent = CuriousAgent(plant.space, plant, beliefs="debiased")
    agent.run(400)
    assert (agent.model.tries > 0).all()


def test_rewards_are_where_the_literature_has_them():
    river, sea = river_swim(6), deep_sea(4)
    assert river.mean_reward[[0, 5], [0, 1]].tolist() == [0.005, 1.0] and np.count_nonzero(river.rewards.any(axis=2)) == 2
    best = sea.mean_reward[[0, 2, 5, 9], 1]
    assert best.sum() == pytest.approx(0.99) and sea.mean_reward[:, 0].tolist() == [0.0] * 10


def test_what_no_decision_problem_has_is_refused():
    for states, actions in ((1, 2), (3, 0), (10**9, 1)):
        with pytest.raises(InvalidValue, match="states and"):
            DiscreteSpace(states, actions)
    with pytest.raises(InvalidValue, match=r"shape \(3, 2\)"):
        DiscreteSpace(3, 2, goals=[[0, 1]])
    with pytest.raises(InvalidValue, match="states 0 to 2"):
        DiscreteSpace(3, 2, goals=[[0, 1], [0, 1], [0, 7]])
    with pytest.raises(InvalidValue, match="states 0 to 2"):
        DiscreteSpace(3, 2, goals=[[0, 1], [0, 1], [0, 1.5]])
    for target in (np.array([0.0, 2.0]), np.array([0.0, 0.5]), np.zeros(3)):
        with pytest.raises(InvalidValue, match="action from 0 to 1"):
            DiscreteSpace(3, 2).action_of(target)
