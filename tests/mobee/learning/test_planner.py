# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from mobee.errors import InvalidValue, MobeeError
from mobee.learning.discrete import DiscreteSpace
from mobee.learning.planner import Planner, passing, shortest_actions, steps_between
from mobee.learning.tabular import TabularPlant, half_space, ideal
from mobee.learning.transitions import TransitionModel
from tests.mobee.learning.toys import arm, torso


class Table:
    """Every action reaches its goal, but for those that are given with the probability that it stays where it was."""

    def __init__(self, space, fails=None):
        shape = (*space.goals.shape, 2)
        self.outcomes = np.zeros(shape, dtype=np.int64)
        self.outcomes[:, :, 0], self.outcomes[:, :, 1] = space.goals, np.arange(len(space))[:, None]
        self.probabilities = np.zeros(shape)
        self.probabilities[space.goals >= 0, 0] = 1.0
        for (state, goal), chance in (fails or {}).items():
            action = space.actions(state).tolist().index(goal)
            self.probabilities[state, action] = 1.0 - chance, chance
        self.outcomes[space.goals < 0] = 0


SPACE = arm(neighbours="equidistant")


INTO_13 = {(s, 13): 0.9 for s in range(81) if 13 in SPACE.actions(s)}  # 13: the middle of the elbow's lowest level


def test_where_all_is_sound_the_plan_is_a_shortest_path_and_avoids_nothing():
    plan = Planner(SPACE, Table(SPACE), [80]).plan(0)
    assert len(plan.path) == 9 and (plan.path[0], plan.path[-1]) == (0, 80)
    for state, action, following in zip(plan.path, plan.actions, plan.path[1:], strict=False):
        assert SPACE.goal(state, action) == following
    assert plan.probabilities == (1.0,) * 8
    assert (plan.success, plan.shortest, plan.avoided) == (1.0, 8, {})
    assert plan.steps == pytest.approx(8.0)


def test_a_plan_goes_round_what_fails_and_names_it():
    plan = Planner(SPACE, Table(SPACE, INTO_13), [14]).plan(12)
    assert 13 not in plan.path
    assert (len(plan.actions), plan.shortest, plan.success) == (4, 2, 1.0)
    assert plan.avoided == {13: pytest.approx(0.1)}
    assert plan.distrusted == {(12, 13): pytest.approx(0.1)}


def test_an_action_is_distrusted_if_a_path_passes_the_state_before_it_by_another_action():
    plan = Planner(SPACE, Table(SPACE, {(13, 14): 0.9}), [14]).plan(12)
    assert (len(plan.actions), plan.shortest) == (4, 2)
    plan = Planner(SPACE, Table(SPACE, {(13, 14): 0.9, **{(12, int(g)): 0.95 for g in SPACE.actions(12) if g != 13}}), [14]).plan(12)
    assert 13 in plan.path and plan.avoided == {}
    assert plan.distrusted == {(13, 14): pytest.approx(0.1)}


def test_a_plan_takes_a_doubtful_action_where_going_round_takes_longer():
    plan = Planner(SPACE, Table(SPACE, {pair: 0.4 for pair in INTO_13}), [14]).plan(12)
    assert plan.path == (12, 13, 14)
    assert plan.success == pytest.approx(0.6)
    assert plan.steps == pytest.approx(1 / 0.6 + 1)
    assert plan.avoided == {}


@pytest.mark.parametrize("start", range(0, 81, 7))
def test_the_mean_number_of_steps_is_that_of_a_robot_that_follows_the_policy(start):
    rng = np.random.default_rng(start)
    beliefs = Table(SPACE, {(s, int(g)): rng.uniform(0, 0.7) for s in range(81) for g in SPACE.actions(s)})
    planner = Planner(SPACE, beliefs, [40])
    taken = []
    for _ in range(2000):
        state, steps = start, 0
        while state != 40:
            action = planner.policy[state]
            state = int(rng.choice(beliefs.outcomes[state, action], p=beliefs.probabilities[state, action]))
            steps += 1
        taken.append(steps)
    assert np.mean(taken) == pytest.approx(planner.plan(start).steps, abs=5 * np.std(taken) / np.sqrt(2000) + 1e-9)


def test_an_outcome_that_was_not_intended_is_used_where_it_is_known():
    table = Table(SPACE)
    action = SPACE.actions(0).tolist().index(1)
    table.outcomes[0, action, 0] = 80  # as if the arm slipped through
    plan = Planner(SPACE, table, [80]).plan(0)
    assert (plan.path, plan.actions) == ((0, 80), (action,))
    assert plan.shortest == 8


def test_the_nearest_of_several_targets_is_taken_and_at_a_target_there_is_nothing_to_do():
    planner = Planner(SPACE, Table(SPACE), [2, 80])
    assert planner.plan(0).path[-1] == 2
    there = planner.plan(80)
    assert (there.path, there.actions, there.success, there.steps, there.shortest) == ((80,), (), 1.0, 0.0, 0)


def test_without_a_path_the_error_names_the_states():
    table = Table(SPACE, {(s, 80): 1.0 for s in range(81) if 80 in SPACE.actions(s)})
    with pytest.raises(MobeeError, match=r"from state 0 of left_arm to \[80\]"):
        Planner(SPACE, table, [80]).plan(0)
    line = DiscreteSpace(100, 1, goals=np.minimum(np.arange(100)[:, None] + 1, 99))
    with pytest.raises(MobeeError, match="or it is so long or so unreliable that with discount=0.5 its value is below"):
        Planner(line, TransitionModel(line).debiased(), [99], discount=0.5).plan(0)
    assert Planner(line, TransitionModel(line).debiased(), [99]).plan(0).shortest == 99
    with pytest.raises(InvalidValue, match="no such state. Valid are 0 to 80"):
        Planner(SPACE, table, [81])
    with pytest.raises(InvalidValue, match="no such state"):
        Planner(SPACE, table, [80]).plan(-1)
    with pytest.raises(InvalidValue, match="give the number of one state"):
        Planner(SPACE, table, [80]).plan([0, 1])
    with pytest.raises(InvalidValue, match="beliefs of 27 states, 8 actions, for a space of 81 states"):
        Planner(SPACE, TransitionModel(torso()), [80])


DIGITS = np.array(list(product(range(3), repeat=4)))[:, ::-1]  # the first joint is the fastest


def ideal_world() -> TabularPlant:
    return TabularPlant(SPACE, *ideal(SPACE))


@pytest.mark.parametrize("start", [0, 13, 40, 77])
def test_on_a_lattice_steps_are_counted_along_the_joints(start):
    for goal in range(81):
        assert steps_between(SPACE, start, np.array([goal])) == np.abs(DIGITS[start] - DIGITS[goal]).sum()
    assert steps_between(SPACE, start, np.array([0, 80])) == min(DIGITS[start].sum(), 8 - DIGITS[start].sum())


@pytest.mark.parametrize(("start", "goal"), [(0, 80), (12, 14), (5, 60), (40, 40)])
def test_the_actions_of_shortest_paths_are_those_that_come_nearer_on_one(start, goal):
    def away(one, other):
        return np.abs(DIGITS[one] - DIGITS[other]).sum()

    wanted = {
        (s, int(g)) for s in range(81) for g in SPACE.actions(s) if away(start, s) + 1 + away(g, goal) == away(start, goal) and s != goal
    }
    found = shortest_actions(SPACE, ideal_world(), start, np.array([goal]))
    assert found.keys() == wanted
    assert set(found.values()) <= {1.0}


def test_chances_are_those_of_ending_at_the_goal():
    world = TabularPlant(SPACE, *half_space(SPACE))
    found = shortest_actions(SPACE, world, 6, np.array([51]))
    assert min(found.values()) < 0.9
    for (state, goal), chance in found.items():
        action = SPACE.actions(state).tolist().index(goal)
        at_goal = world.outcomes[state, action] == goal
        assert chance == pytest.approx(world.probabilities[state, action][at_goal].sum())


def test_the_best_actions_into_and_out_of_a_state_count():
    assert passing({(0, 1): 0.5, (3, 1): 0.8, (1, 2): 0.9, (1, 4): 0.2}) == {1: pytest.approx(0.72)}
    assert passing({(0, 1): 0.5}) == {}
