# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch8_reaching.reach_under_model_error import CLAIMS, MARGIN, MIN_LEAD, crossover, verdict
from experiments.kit.experiment import judged
from tests.experiments.finished_cells import Cell, finished

TRIES = [100, 200, 800]
SEEDS = 6


def sweep(learner, peers):
    """Finished cells whose success is given."""
    given = {"learner": learner, **peers}

    def work(cell):
        shares = given[cell.settings["contestant"]]
        rows = [{"fates": [s, 1.0 - s, 0.0, 0.0], "seconds": 10.0, "actions": 3.0, "hours": 1.0} for s in shares]
        return {"rows": rows, "planning": [0.1, 0.2]}

    return finished(
        work,
        [
            Cell(f"{contestant}-{wrong}-{seed}", seed, {"contestant": contestant, "wrong": wrong, "tries": TRIES})
            for seed in range(SEEDS)
            for wrong in ("nothing", "planners", "everyone")
            for contestant in given
        ],
    )


def peers(none=0.5, blocked=0.5, missed=0.9):
    return {"none": [none] * 3, "blocked": [blocked] * 3, "missed": [missed] * 3}


@pytest.mark.parametrize(
    ("none", "blocked", "least", "expected"),
    [
        (0.3, 0.25, MIN_LEAD, True),
        (0.3, 0.1, MIN_LEAD, False),  # it must lead both
        (-0.02, 0.0, -MARGIN, True),
        (-0.1, 0.3, -MARGIN, False),
    ],
)
def test_the_learner_must_lead_both_peers(none, blocked, least, expected):
    leads = {"none": np.full(SEEDS, none), "blocked": np.full(SEEDS, blocked)}
    assert verdict(leads, least) is expected


def test_a_lead_whose_interval_contains_the_bound_is_open():
    spread = np.array([0.0, 0.4, 0.1, 0.3, 0.05, 0.35])
    assert verdict({"none": spread, "blocked": np.full(SEEDS, 0.5)}, MIN_LEAD) is None


def test_each_claim_is_about_its_own_number_of_tries():
    found = judged(CLAIMS, sweep([0.2, 0.5, 0.8], peers(missed=0.5)))
    assert [claim["verdict"] for claim in found] == ["met"] * 4 + ["not reproduced"]
    for beaten in (peers(missed=0.5), peers(none=0.1, blocked=0.1, missed=0.5)):  # the strongest peer decides
        found = judged(CLAIMS, sweep([0.9, 0.3, 0.6], beaten))
        assert [claim["verdict"] for claim in found[:4]] == ["not met"] * 4
    found = judged(CLAIMS, sweep([0.9, 0.3, 0.6], peers(missed=0.5)))
    assert "0.60" in found[1]["ours"] and "lead 0.10" in found[1]["ours"]


def test_claims_without_cells_are_open():
    found = judged(CLAIMS, {})
    assert [claim["verdict"] for claim in found] == ["open"] * len(CLAIMS)


def test_the_crossover_is_the_number_of_tries_from_which_the_learner_stays_no_lower():
    learner = np.array([[0.6, 0.4, 0.7], [0.5, 0.5, 0.5], [0.1, 0.2, 0.3]])
    peer = np.full((3, 3), 0.5)
    assert crossover(TRIES, learner, peer).tolist() == [800.0, 100.0, np.inf]
