# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch7_learning.reward_decay import EXPLORERS, findings, trial
from tests.experiments.finished_cells import Cell, finished


def test_the_rewards_are_those_of_the_model_after_the_given_transitions():
    values = trial({"explorer": "curious", "times": [1, 40]}, 0)
    assert values["rewards"].shape == (2, 1296)
    assert np.sum(values["rewards"][0] < 0.058) == 1  # one action was tried
    assert values["rewards"][0].max() == pytest.approx(0.0589, abs=5e-5)


def test_faster_and_more_uniform_decay_confirms_the_claims():
    left = {"curious": 0.1, "least_tried": 0.5, "random": 1.0}

    def work(cell):
        rewards = np.full((1, 100), 0.01 * left[cell.settings["explorer"]])
        rewards[:, 0] *= 1.0 + 10.0 * left[cell.settings["explorer"]]
        return {"rewards": rewards, "times": [4000]}

    cells = [Cell(f"{explorer}-{seed}", seed, {"explorer": explorer}) for explorer in EXPLORERS for seed in range(3)]
    assert {claim["verdict"] for claim in findings(finished(work, cells))["claims"]} == {"confirmed"}
