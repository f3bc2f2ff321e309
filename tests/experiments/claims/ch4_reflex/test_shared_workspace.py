# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from experiments.claims.ch4_reflex.shared_workspace import EXPERIMENT, PROTECTIONS, findings
from experiments.claims.ch4_reflex.shared_workspace_trial import Truth, is_between, run_trial, watch_of
from experiments.kit.two_robots import two_robots
from mobee.model.model import Model
from mobee.model.world_file import load_world
from tests.experiments.options import options_of


@pytest.fixture(scope="module")
def touching() -> np.ndarray:
    """A posture in which the robots touch: the first of many at random."""
    robot, rng = two_robots(), np.random.default_rng(0)
    model = Model(robot, load_world("table"))
    while True:
        q = rng.uniform(*robot.limits.T)
        if any(one.kind == "solid" and one.depth > 0.01 and is_between(one.first, one.second) for one in model.evaluate(q).contacts):
            return q


def test_a_contact_between_the_robots_triggers_both_reflexes_and_counts_once(touching):
    model, truth = Model(two_robots(), load_world("table")), Truth()
    pose = model.evaluate(touching)
    between = {one.what for one in watch_of(("icub",))(pose)} & {one.what for one in watch_of(("katana",))(pose)}
    assert between and all("katana_" in one and not one.startswith("katana_arm_0_link_field - table") for one in between)
    assert watch_of(("katana",))(model.evaluate(two_robots().home)) == []  # its base stands on the table
    for _ in range(3):
        truth.note(pose)
    deep = [one for one in pose.contacts if one.kind == "solid" and one.depth > 0.002 and is_between(one.first, one.second)]
    assert truth.collisions == len(deep) and truth.deepest == max(one.depth for one in deep) and truth.path == 0.0


@pytest.mark.parametrize("name", PROTECTIONS)
def test_robots_move_under_every_protection_and_a_seed_gives_the_same_run(name):
    protection, paces = PROTECTIONS[name]
    first, again = (run_trial(protection, 0.03, paces, seed=1) for _ in range(2))
    assert first == again and first["path"] > 0.5 and first["collisions"] == 0


def test_claims_need_all_protections_and_a_deep_contact_fails_the_aim():
    def cells(deepest: float) -> dict[str, Any]:
        row = {"minutes": 12.0, "collisions": 0, "deepest_own": 0.0, "path": 100.0, "near": 1, "reflexes": 2, "stuck": 0}
        depth = {name: deepest if name == "controllers" else 0.0 for name in PROTECTIONS}
        every = EXPERIMENT.method.cells(options_of(EXPERIMENT))
        return {one.name: SimpleNamespace(cell=one, values={**row, "deepest": depth[one.settings["condition"]]}) for one in every}

    verdicts = [findings(cells(depth))["claims"][0]["verdict"] for depth in (0.0019, 0.0021)]
    assert verdicts == ["met", "not met"]
    few = {name: one for name, one in cells(0.0).items() if one.cell.settings["condition"] == "controllers"}
    assert {claim["verdict"] for claim in findings(few)["claims"]} == {"open"}
