# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from experiments.claims.ch7_learning.mdp_planner import CLAIMS, ENTERS, ROADMAPS, fates, runs_of
from experiments.claims.ch7_learning.planned_queries import (
    DOWN,
    PERIOD,
    UP,
    FrozenModel,
    TablePlant,
    drawn_pairs,
    follow,
    promises,
    through,
    touched_states,
)
from experiments.kit.cells import Cell, load_cells, write_cell
from experiments.kit.experiment import judged
from experiments.kit.learning.arm import ARM_NEIGHBOURS, RANK3, arm_space
from mobee import TransitionModel

AFTER = [0, 1000]


def means(success, touched=0.2):
    return {
        "success": success,
        "actions": 5.0 - 2.0 * success,
        "touched": touched,
        "met": touched,
        "promised": 0.9,
        "kept": 0.9,
        "through": 0.3,
    }


def in_worlds(success, touched):
    return {test: means(success, touched) for test in ("down", "moving", "up")}


@pytest.fixture
def done(tmp_path):
    """Four seeds in which an MDP trained with the moving table meets it less often, and a roadmap that is repaired works."""
    for seed in range(4):
        fates = {"tried": 100, "goal": 90, "elsewhere": 6, "sometimes": 4}
        written = {
            "still": {"tests": {"plans": in_worlds(0.9, 0.4 + 0.01 * seed)}, "fates": fates},
            "moving": {"tests": {"plans": in_worlds(0.97, 0.3)}, "fates": fates},
            "roadmap": {"tests": dict(zip(ROADMAPS, (in_worlds(0.5, 0.5), in_worlds(0.95, 0.4), in_worlds(0.97, 0.3)), strict=True))},
        }
        for training, values in written.items():
            write_cell(tmp_path, Cell(f"{training}-s{seed}", seed, {"training": training}), values, 1.0)
        for forgetting in ENTERS:
            settings = {"training": "enters", "forgetting": forgetting}
            values = {"after": AFTER, "rows": [means(0.8), means(0.98)]}
            write_cell(tmp_path, Cell(f"enters-{forgetting:g}-s{seed}", seed, settings), values, 1.0)
    return load_cells(tmp_path)


def test_the_claims_follow_from_the_numbers(done):
    fig7, enters, inoperable, predictable, avoids = judged(CLAIMS, runs_of(done))
    assert [claim["verdict"] for claim in (fig7, enters, inoperable)] == ["confirmed", "confirmed", "depends"]
    assert [claim["verdict"] for claim in (predictable, avoids)] == ["confirmed", "confirmed"]
    assert inoperable["settings"] == "when a motion fails: holds for planned once; fails for repairs, remembers"
    assert "0.50" in inoperable["ours"] and "0.95" in inoperable["ours"]
    assert "0.80" in enters["ours"] and "1000 transitions later" in enters["ours"]


@pytest.fixture(scope="module")
def space():
    return arm_space(RANK3, ARM_NEIGHBOURS)


def test_the_raised_table_touches_some_states(space):
    plant = TablePlant(0)
    down, up = touched_states(plant, space, DOWN), touched_states(plant, space, UP)
    assert (up >= down).all() and 5 < (up & ~down).sum() < 40


def test_the_table_is_between_start_and_goal_of_a_query_and_in_neither(space):
    plant = TablePlant(0)
    wanted = drawn_pairs(plant, space, 10, seed=1)
    assert len(set(wanted)) == 10 and not touched_states(plant, space, UP)[np.array(wanted)].any()
    assert wanted == drawn_pairs(plant, space, 10, seed=1) != drawn_pairs(plant, space, 10, seed=2)


def test_a_moving_table_moves_after_every_period_and_a_still_one_never(space):
    moving, still = TablePlant(0, moves=True), TablePlant(0)
    tops = []
    for action in range(4 * PERIOD):
        for plant in (moving, still):
            plant.act("left_arm", space.target(0))
        tops.append(moving.world.objects["table"].position[2])
        assert action % PERIOD == 0 or tops[-1] == tops[-2]
    assert len(set(tops)) == 2 and still.world.version == 1


def test_a_plan_without_obstacle_is_followed(space):
    beliefs = TransitionModel(space).debiased()
    wanted = [(0, int(space.goal(0, 0)))]
    followed = follow(space, FrozenModel(space, beliefs), wanted, [DOWN], seed=0)
    assert (followed.success, followed.actions, followed.touched, followed.met, followed.paths) == (1.0, 1.0, 0.0, 0.0, (wanted[0],))
    promised, kept = promises(space, beliefs, wanted, followed.paths)
    assert promised == pytest.approx(0.75) and kept == 1.0  # an untried action is believed to succeed with 0.3 of 0.4


def test_start_and_end_do_not_count_as_states_on_the_path():
    blocked = np.array([True, True, False, True])
    assert through([(0, 1, 2, 3), (1, 2), (3,)], blocked) == 0.5
    assert through([(0, 1)], blocked) == 0.0


def test_fates_count_actions_that_were_tried_twice(space):
    model = TransitionModel(space)
    for state, action, ends in ((0, 0, (int(space.goal(0, 0)),) * 4), (1, 0, (70,) * 4), (2, 0, (70, int(space.goal(2, 0)))), (3, 0, (3,))):
        for end in ends:
            model.observe(state, action, end)
    assert fates(model) == {"tried": 3, "goal": 1, "elsewhere": 1, "sometimes": 1}


def test_without_a_known_path_the_predicted_probability_is_zero(space):
    shape, goal = space.goals.shape, int(space.goal(0, 0))
    stuck = SimpleNamespace(outcomes=np.indices(shape)[0][..., None], probabilities=np.ones((*shape, 1)))
    assert promises(space, stuck, [(0, goal)], [(0, 0)]) == (0.0, 0.0)
