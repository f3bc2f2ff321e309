# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np

from experiments.claims.ch7_learning.neighbour_count import attempt, denser, fewest_actions, findings, trial
from experiments.kit.learning.arm import HYPERCUBE, arm_plant, arm_space
from mobee import TransitionModel
from tests.experiments.finished_cells import Cell, finished


def test_a_sparser_graph_is_learnt_sooner_and_its_paths_are_longer():
    cells = [Cell(f"k{graph}", 1, {"graph": graph, "budgets": [700], "tasks": 8}) for graph in (4, 16)]
    rows = findings(finished(lambda cell: trial(cell.settings, cell.seed), cells))["runs"]
    assert rows["4 neighbours"]["state_actions"] == 324 and rows["16 neighbours"]["state_actions"] == 1296
    sparse, dense = rows["4 neighbours"], rows["16 neighbours"]
    assert sparse["transitions_until_all_tried"] < 700 and dense["transitions_until_all_tried"] is None
    assert sparse["actions_per_solved_task"] > dense["actions_per_solved_task"]


def test_the_fewest_actions_of_a_hypercube_are_the_differing_joints():
    space = arm_space(HYPERCUBE)
    for start, goal in ((0, 15), (0, 8), (5, 10), (3, 7)):
        assert fewest_actions(space, start, goal) == (start ^ goal).bit_count()


def test_where_no_actions_lead_there_are_no_fewest():
    assert fewest_actions(arm_space(neighbours=4, tie_seed=1014), 42, 38) == 0


def test_a_known_model_leads_the_arm_to_its_goal_by_the_shortest_path():
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


def test_each_further_comparison_makes_the_intervals_wider():
    def runs(failures):
        reached = [np.arange(10) >= failed for failed in (failures, *[0] * 9)]
        return [{"budgets": [1000], "reached": [one], "actions": [np.ones(10)], "fewest": np.ones(10)} for one in reached]

    published, sparser = runs(0), runs(1)
    assert denser.rule({12: sparser, 16: published})[1] is True
    assert denser.rule({4: sparser, 6: sparser, 8: sparser, 12: sparser, 16: published})[1] is None
    assert denser.rule({4: runs(0), 6: sparser, 8: sparser, 12: sparser, 16: published})[1] is True
