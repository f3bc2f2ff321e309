from __future__ import annotations

import numpy as np

from experiments.connectivity.tasks import Tasks, attempt, fewest_actions
from experiments.kit.arm_learning import HYPERCUBE, arm_plant, arm_space
from mobee import TransitionModel


def test_the_fewest_actions_of_a_hypercube_are_the_differing_joints():
    space = arm_space(HYPERCUBE)
    for start, goal in ((0, 15), (0, 8), (5, 10), (3, 7)):
        assert fewest_actions(space, start, goal) == (start ^ goal).bit_count()


def test_a_known_model_leads_the_arm_to_its_goal_by_the_shortest_way():
    space = arm_space(HYPERCUBE)
    model = TransitionModel(space)
    for state in range(len(space)):
        for action, goal in enumerate(space.actions(state)):
            model.observe(state, action, int(goal))
    found = attempt(model, arm_plant(0), 0, 15, most=12)
    assert found.reached and found.actions == 4


def test_an_attempt_that_takes_too_long_is_a_failure():
    space = arm_space(HYPERCUBE)
    found = attempt(TransitionModel(space), arm_plant(0), 0, 15, most=2)
    assert not found.reached and found.actions == 2


def test_tasks_are_pairs_of_different_states_and_follow_from_the_seed():
    tasks = Tasks.drawn(arm_space(HYPERCUBE), 20, seed=3)
    assert tasks == Tasks.drawn(arm_space(HYPERCUBE), 20, seed=3) != Tasks.drawn(arm_space(HYPERCUBE), 20, seed=4)
    assert all(start != goal for start, goal in np.array(tasks.pairs))
