from __future__ import annotations

import numpy as np
import pytest

from experiments.learning.published import ARM_NEIGHBOURS, RANK3, arm_space
from experiments.planner.findings import fates
from experiments.planner.following import follow, queries, zone
from experiments.planner.table import DOWN, PERIOD, UP, TablePlant
from mobee import TransitionModel


@pytest.fixture(scope="module")
def space():
    return arm_space(RANK3, ARM_NEIGHBOURS)


def test_the_raised_table_is_in_the_way_of_some_states_and_the_lowered_one_of_none(space):
    plant = TablePlant(0)
    down, up = zone(plant, space, DOWN), zone(plant, space, UP)
    assert (up >= down).all() and 5 < (up & ~down).sum() < 40


def test_queries_begin_and_end_free_with_the_table_between(space):
    plant = TablePlant(0)
    wanted = queries(plant, space, 10, seed=1)
    assert len(set(wanted)) == 10 and not zone(plant, space, UP)[np.array(wanted)].any()
    assert wanted == queries(plant, space, 10, seed=1) != queries(plant, space, 10, seed=2)


def test_a_moving_table_moves_after_so_many_actions_and_a_still_one_never(space):
    moving, still = TablePlant(0, moves=True), TablePlant(0)
    tops = []
    for action in range(4 * PERIOD):
        for plant in (moving, still):
            plant.act("left_arm", space.target(0))
        tops.append(moving.world.objects["table"].position[2])
        assert action % PERIOD == 0 or tops[-1] == tops[-2]
    assert len(set(tops)) == 2 and still.world.version == 1


def test_a_plan_without_obstacle_is_kept_and_its_way_is_counted(space):
    model = TransitionModel(space)
    wanted = [(0, int(space.goal(0, 0)))]
    followed = follow(space, model.debiased(), wanted, [DOWN], np.ones(len(space), dtype=bool), seed=0)
    assert (followed.success, followed.actions, followed.kept, followed.touched, followed.through) == (1.0, 1.0, 1.0, 0.0, 0.0)
    assert followed.promised == pytest.approx(0.75)  # what an untried action is believed to do: 0.3 of 0.4


def test_fates_count_what_was_tried_twice(space):
    model = TransitionModel(space)
    for state, action, ends in ((0, 0, (int(space.goal(0, 0)),) * 4), (1, 0, (70,) * 4), (2, 0, (70, int(space.goal(2, 0)))), (3, 0, (3,))):
        for end in ends:
            model.observe(state, action, end)
    assert fates(model) == {"tried": 3, "goal": 1, "elsewhere": 1, "sometimes": 1}
