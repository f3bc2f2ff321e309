# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch8_reaching.reach_vs_planners import CONTESTANTS, SCENES, findings
from tests.experiments.finished_cells import Cell, finished


def sweep(learner=0.9, peer=0.9, seconds=0.01, smoothing=0.1):
    def work(cell):
        if cell.settings["scene"] == "two arms":
            arms = {"found": np.ones(4), "seconds": np.full(4, seconds), "smoothing": np.full(4, smoothing)}
            return arms | {"corners": np.full(4, 3), "missing": np.full(4, 0.01)}
        values = {}
        for scene in SCENES:
            for contestant, share in zip(CONTESTANTS, (learner, peer), strict=True):
                values[f"{scene}|{contestant}|success"] = np.arange(10) < 10 * share
                values[f"{scene}|{contestant}|seconds"] = np.full(10, 5.0)
                values[f"{scene}|{contestant}|thinking"] = np.full(10, 0.001)
        return values

    kinds = ("cases", "two arms")
    return findings(finished(work, [Cell(f"{kind[:4].strip()}-s{seed}", seed, {"scene": kind}) for seed in range(6) for kind in kinds]))


def verdicts(**given):
    return [claim["verdict"] for claim in sweep(**given)["claims"]]


@pytest.mark.parametrize(("learner", "expected"), [(0.9, "met"), (1.0, "met"), (0.8, "not met")])
def test_the_learner_may_be_at_most_5_points_below_the_planner(learner, expected):
    assert verdicts(learner=learner)[:3] == [expected] * 3


@pytest.mark.parametrize(
    ("seconds", "smoothing", "expected"), [(0.01, 0.1, "not reproduced"), (5.0, 60.0, "confirmed"), (5.0, 0.1, "not reproduced")]
)
def test_a_planner_is_slow_if_it_takes_a_tenth_of_the_published_time(seconds, smoothing, expected):
    assert verdicts(seconds=seconds, smoothing=smoothing)[3:] == [expected]
