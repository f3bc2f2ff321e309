from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from mobee.learning.planner import passing, shortest_actions, steps_between
from mobee.learning.tabular import TabularPlant, half_space, ideal
from tests.mobee.learning.toys import arm

SPACE = arm(neighbours="equidistant")
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


def test_the_best_way_in_and_out_of_a_state_counts():
    assert passing({(0, 1): 0.5, (3, 1): 0.8, (1, 2): 0.9, (1, 4): 0.2}) == {1: pytest.approx(0.72)}
    assert passing({(0, 1): 0.5}) == {}
