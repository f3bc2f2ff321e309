# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import InvalidValue, UnknownName
from mobee.learning.agent import CuriousAgent, run
from mobee.learning.tabular import TabularPlant, half_space, ideal
from tests.mobee.learning.toys import arm, torso
from tests.mobee.learning.worlds import deep_sea, river_swim

HARD = (24, 51, 78)


def test_an_ideal_world_ends_every_action_at_its_goal():
    space = arm(neighbours="equidistant")
    plant = TabularPlant(space, *ideal(space), start=40)
    assert np.array_equal(plant.measure("left_arm"), space.target(40))
    for goal in (41, 40, 13, 14):
        outcome = plant.act("left_arm", space.target(goal))
        assert outcome.settled and np.array_equal(outcome.q, space.target(goal))
        assert space.state_of(plant.measure("left_arm")[space.columns]) == plant.state == goal


def test_outcomes_come_with_their_probabilities():
    plant = river_swim(6, seed=1)
    ends = []
    for _ in range(4000):
        plant.state = 3
        plant.act("left_arm", plant.space.target(4))
        ends.append(plant.state)
    assert np.bincount(ends, minlength=6) / 4000 == pytest.approx([0, 0, 0.05, 0.6, 0.35, 0], abs=0.03)


def test_what_is_drawn_follows_from_the_seed_and_the_number_of_actions():
    def ends(plant, count):
        return [int(plant.act("left_arm", plant.space.target(min(plant.state + 1, 5))).q is None or plant.state) for _ in range(count)]

    whole = ends(river_swim(6, seed=4), 5000)
    first, then = river_swim(6, seed=4), river_swim(6, seed=4)
    begun = ends(first, 4090)
    then.state, then.actions = first.state, first.actions
    assert begun + ends(then, 910) == whole
    assert ends(river_swim(6, seed=5), 5000) != whole


def test_agents_run_on_it_in_parallel_as_alone():
    def make():
        plant = TabularPlant(torso(), *ideal(torso()))
        return CuriousAgent(plant.space, plant)

    alone, together = make(), make()
    alone.run(50)
    run([together], 50)
    assert np.array_equal(alone.model.tries, together.model.tries)


@pytest.mark.parametrize(("neighbours", "stochastic"), [("equidistant", 13), (16, 32)])
def test_the_half_space_makes_the_entries_of_three_states_stochastic(neighbours, stochastic):
    space = arm(neighbours=neighbours)
    outcomes, probabilities = half_space(space)
    uncertain = (probabilities > 0).sum(axis=-1) > 1
    assert np.array_equal(uncertain, np.isin(space.goals, HARD))
    assert uncertain.sum() == pytest.approx(stochastic, abs=8 if neighbours == 16 else 0)  # the drawn ties decide
    certain = (space.goals >= 0) & ~uncertain
    assert np.array_equal(outcomes[certain, 0], space.goals[certain])
    TabularPlant(space, outcomes, probabilities)  # a valid table


def test_the_half_space_is_the_normal_distribution_cut_by_the_cells():
    space = arm(neighbours="equidistant")
    outcomes, probabilities = half_space(space, depth=0.5, memory=0.2, noise=(0.01, 0.08))
    action = space.actions(21).tolist().index(24)
    low, high = np.array([0.25, 0.75, 0.75, 0.25]), np.array([-1, 1, 1, 0]) / np.sqrt(3)
    settled = low - 0.5 * 0.25 / np.sqrt(3) * high  # half way to the next states, .25 / sqrt(3) nearer
    mean = settled + 0.2 * (np.array([0.25, 0.5, 0.75, 0.25]) - settled)
    drawn = np.random.default_rng(0).normal(mean, 0.08, size=(200_000, 4))
    digits = (drawn[:, :, None] > np.array([0.375, 0.625])).sum(axis=-1)
    expected = np.bincount(digits @ 3 ** np.arange(4), minlength=81) / len(drawn)
    found = np.bincount(outcomes[21, action], weights=probabilities[21, action], minlength=81)
    assert found == pytest.approx(expected, abs=0.004)


def test_river_swim_and_deep_sea_have_the_published_sizes():
    assert river_swim(6).space.state_actions == 12
    assert river_swim(20).space.state_actions == 40
    sea = deep_sea(10)
    assert (len(sea.space), sea.space.state_actions) == (55, 110)
    assert sea.outcomes[-1].tolist() == [[0], [0]]
    for _ in range(9):
        sea.act("left_arm", sea.space.target(int(sea.outcomes[sea.state, 1, 0])))
    assert sea.state == 54


def test_a_target_that_is_no_neighbour_and_a_part_that_is_not_there_are_refused():
    plant = TabularPlant(torso(), *ideal(torso()))
    with pytest.raises(InvalidValue, match="no action to 26"):
        plant.act("torso", plant.space.target(26))
    for call in (lambda: plant.measure("head"), lambda: plant.act("head", np.zeros(3)), lambda: plant.begin("head", np.zeros(3))):
        with pytest.raises(UnknownName, match="Valid: torso"):
            call()
    with pytest.raises(InvalidValue, match="begin one first"):
        plant.advance()
    plant.begin("torso", plant.space.target(1))
    with pytest.raises(InvalidValue, match="under way"):
        plant.begin("torso", plant.space.target(1))


def test_tables_that_are_none_are_refused():
    space = torso()
    outcomes, probabilities = ideal(space)
    for wrong, message in (
        ((outcomes[:5], probabilities[:5]), "give both as"),
        ((outcomes, 0.5 * probabilities), "sum to 1"),
        ((outcomes, -probabilities), "sum to 1"),
        ((outcomes + 27, probabilities), "states 0 to 26"),
    ):
        with pytest.raises(InvalidValue, match=message):
            TabularPlant(space, *wrong)
    with pytest.raises(InvalidValue, match="one component for each"):
        half_space(space)
