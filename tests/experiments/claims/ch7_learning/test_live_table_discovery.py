# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import argparse

import numpy as np
import pytest

from experiments.claims.ch7_learning import live_table_discovery
from experiments.claims.ch7_learning.live_table_discovery import live_cells, offline_cells, results
from experiments.kit.cells import write_cell
from experiments.kit.learning.live import TASKS, space
from mobee import load_robot

ROBOT = load_robot("icub")
PARTS = TASKS["published"].parts


def learned(rng, odd, share):
    """Every first action of 27 states four times; it fails once in a while, and `odd` always; a share ends at the table."""
    values = {}
    for part in PARTS:
        goals = space(ROBOT, TASKS["published"], part).goals
        seen = [(s, 0, s if odd or rng.random() < 0.2 else int(goals[s, 0])) for s in range(27) for _ in range(4)]
        values |= {f"seen_{part}": rng.permutation(np.array(seen)), f"touched_{part}": np.arange(108) % 10 < 10 * share}
    return values


def prepared(folder, odd, share=0.2, live_seeds=5):
    arguments = argparse.Namespace(seed=0, seeds=19, quick=False, transitions=108, robots=["kinematic", "mujoco"], live_seeds=live_seeds)
    for cell in (*offline_cells(arguments), *live_cells(arguments)):
        is_odd = odd and cell.settings.get("robot") == "mujoco"
        write_cell(folder, cell, learned(np.random.default_rng(cell.seed), is_odd, share if is_odd else 0.2), 1.0)
    return results(folder)


def verdicts(found):
    return [one["verdict"] for one in found["claims"]]


def test_live_runs_that_are_as_the_offline_ones_are_equivalent(tmp_path):
    found = prepared(tmp_path, odd=False)
    assert verdicts(found)[1:] == ["met", "met"]
    assert {name: row["runs"] for name, row in found["runs"].items()} == {"offline": 19, "kinematic": 5, "mujoco": 5}
    assert found["runs"]["mujoco"]["state-actions compared"] == 3 * 27
    assert found["at the table"]["mujoco, torso"]["actions"] == 5 * 108
    assert live_table_discovery.figure(tmp_path).exists()


def test_one_engine_on_which_actions_fail_is_enough_for_a_difference(tmp_path):
    found = prepared(tmp_path, odd=True, share=0.5)
    assert verdicts(found)[:2] == ["not met", "not met"]
    assert found["runs"]["mujoco"]["total variation"] > found["runs"]["kinematic"]["total variation"]


@pytest.mark.parametrize("odd", [False, True])
def test_few_live_runs_decide_nothing(tmp_path, odd):
    found = prepared(tmp_path, odd, live_seeds=4)
    assert verdicts(found) == ["open"] * 3 and "4 live runs, too few" in found["claims"][0]["ours"]
