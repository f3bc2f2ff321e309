# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch8_reaching.planner_reach_ablation import LAWS, findings
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


@pytest.mark.parametrize(("reach", "expected"), [(0.5, ["confirmed", "met"]), (0.9, ["refuted", "not met"]), (1.0, ["refuted", "not met"])])
def test_both_together_must_achieve_more_than_the_reach_alone_in_every_situation(reach, expected):
    found = findings(sweep(planner=0.3, reach=reach, both=0.9))["claims"]
    assert [claim["verdict"] for claim in found] == expected
    assert f"reach alone 0.{int(10 * reach):02}" in found[0]["ours"] or reach != 0.5
