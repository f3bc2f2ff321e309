# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch8_reaching.planner_reach_ablation import LAWS, does_more, findings
from experiments.kit.reaching.cases import METHODS, SCENES
from tests.experiments.finished_cells import Cell, finished


def sweep(**shares):
    def work(cell):
        values = {}
        for scene in SCENES:
            for method in METHODS:
                values[f"{scene}|{method}|missing"] = np.where(np.arange(10) < 10 * shares[method], 0.01, 0.1)
                values[f"{scene}|{method}|seconds"] = np.full(10, 5.0)
                values[f"{scene}|{method}|reward"] = np.full(10, shares[method] / 10.0)
        return values

    return finished(work, [Cell(f"{law}-s{seed}", seed, {"law": law}) for seed in range(6) for law in LAWS])


@pytest.mark.parametrize(("planner", "reach", "expected"), [(0.2, 0.6, True), (0.2, 0.8, None), (0.9, 0.1, False)])
def test_both_together_must_succeed_more_often_than_each_alone(planner, reach, expected):
    both = np.full(6, 0.8)
    assert does_more(both, {"planner": np.full(6, planner), "reach": np.full(6, reach)}) is expected


def test_each_scene_has_a_claim_about_the_measure_of_its_law():
    found = findings(sweep(planner=0.3, reach=0.5, both=0.9))["claims"]
    assert len(found) == len(LAWS) * len(SCENES) and {claim["verdict"] for claim in found} == {"confirmed"}
    assert "reward planner alone 0.03" in found[0]["ours"] and "success planner alone 0.30" in found[-1]["ours"]
