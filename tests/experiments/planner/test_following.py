from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from experiments.kit.arm_learning import ARM_NEIGHBOURS, RANK3, arm_space
from experiments.planner.findings import fates
from experiments.planner.following import Frozen, follow, promises, queries, through, zone
from experiments.planner.table import DOWN, PERIOD, UP, TablePlant
from experiments.planner.trial import Trial, roadmaps
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
    beliefs = TransitionModel(space).debiased()
    wanted = [(0, int(space.goal(0, 0)))]
    followed = follow(space, Frozen(space, beliefs), wanted, [DOWN], seed=0)
    assert (followed.success, followed.actions, followed.touched, followed.met, followed.ways) == (1.0, 1.0, 0.0, 0.0, (wanted[0],))
    promised, kept = promises(space, beliefs, wanted, followed.ways)
    assert promised == pytest.approx(0.75) and kept == 1.0  # an untried action is believed to succeed with 0.3 of 0.4


def test_states_on_the_way_count_without_start_and_end():
    blocked = np.array([True, True, False, True])
    assert through([(0, 1, 2, 3), (1, 2), (3,)], blocked) == 0.5
    assert through([(0, 1)], blocked) == 0.0


def test_a_roadmap_that_knows_no_table_fails_at_it_and_recovers_when_repaired(space):
    plant = TablePlant(0)
    trial = Trial.of_seed(plant, space, 60, seed=0)
    rivals = roadmaps(plant, space)
    once, repairs = (trial.in_all_worlds(rivals[name]) for name in ("planned once", "repairs"))
    assert once["down"]["success"] == repairs["down"]["success"] == 1.0 and once["down"]["touched"] == 0.0
    assert once["up"]["success"] < repairs["up"]["success"]


def test_fates_count_what_was_tried_twice(space):
    model = TransitionModel(space)
    for state, action, ends in ((0, 0, (int(space.goal(0, 0)),) * 4), (1, 0, (70,) * 4), (2, 0, (70, int(space.goal(2, 0)))), (3, 0, (3,))):
        for end in ends:
            model.observe(state, action, end)
    assert fates(model) == {"tried": 3, "goal": 1, "elsewhere": 1, "sometimes": 1}


def test_a_goal_to_which_no_way_is_known_promises_nothing(space):
    shape, goal = space.goals.shape, int(space.goal(0, 0))
    stuck = SimpleNamespace(outcomes=np.indices(shape)[0][..., None], probabilities=np.ones((*shape, 1)))
    assert promises(space, stuck, [(0, goal)], [(0, 0)]) == (0.0, 0.0)
