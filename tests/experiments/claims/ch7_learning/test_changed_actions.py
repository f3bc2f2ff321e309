# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch7_learning.changed_actions import AFTER, AGENTS, CHECK_PERIOD, CLAIMS, JUDGED_AFTER, OURS, left, trial
from experiments.kit.experiment import judged


def test_a_change_makes_errors_and_none_makes_none():
    settings = {"agent": OURS, "before": 200, "after": 2 * CHECK_PERIOD}
    changed, same = (trial(settings | {"changed": is_changed}, 0) for is_changed in (True, False))
    assert changed["errors"].shape == same["errors"].shape == (3, 2)
    assert changed["errors"][0, 0] > 1.0 and same["errors"][0, 0] == 0.0
    assert changed["errors"][0, 1] == pytest.approx(same["errors"][0, 1], rel=0.2)


def runs(error_left, error):
    """Five equal runs of each agent: the error of changed actions in the end, and that in a world that does not change, by agent."""
    found = {}
    for agent in AGENTS:
        changed, same = np.ones((AFTER // CHECK_PERIOD + 1, 2)), np.full((AFTER // CHECK_PERIOD + 1, 2), error[agent])
        changed[1:, 0] = error_left[agent]
        found[agent, True] = [{"errors": changed, "tries": 1.0 / error_left[agent]}] * 5
        found[agent, False] = [{"errors": same, "tries": 1.0}] * 5
    return found


def test_claims_compare_with_every_other_agent():
    best = dict.fromkeys(AGENTS, 0.4) | {OURS: 0.1}
    assert left(runs(best, best)[OURS, True][0], JUDGED_AFTER) == pytest.approx(0.1)
    verdicts = [
        [claim["verdict"] for claim in judged(CLAIMS, runs(*given))]
        for given in ((best, dict.fromkeys(AGENTS, 0.03)), (best | {"forgetting .8": 0.05}, dict.fromkeys(AGENTS, 0.03) | {OURS: 0.04}))
    ]
    assert verdicts == [["met", "met", "met"], ["not met", "met", "not met"]]
