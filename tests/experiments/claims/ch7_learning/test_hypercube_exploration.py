# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch7_learning.hypercube_exploration import findings, relative_variance, trial
from tests.experiments.finished_cells import Cell, finished


def test_a_random_choice_has_relative_variance_one_and_equal_tries_zero():
    rng = np.random.default_rng(0)
    drawn = [relative_variance(np.bincount(rng.integers(64, size=320), minlength=64)) for _ in range(400)]
    assert np.mean(drawn) == pytest.approx(1.0, abs=0.05)
    assert relative_variance(np.full(64, 5)) == 0.0


def test_every_action_of_the_hypercube_succeeds_and_is_tried_five_times():
    found = finished(
        lambda cell: trial(cell.settings, cell.seed),
        [Cell(f"g{discount:g}-s0", 0, {"initial": "50-50", "discount": discount}) for discount in (0.5, 0.9)],
    )
    values = found["g0.9-s0"].values
    assert values["failed"] == 0 and values["tries"].min() == 5 and values["early_tries"].sum() == 50
    assert 320 <= values["transitions"] == values["tries"].sum() <= 340
    assert [claim["verdict"] for claim in findings(found)["claims"][:2]] == ["confirmed", "confirmed"]
