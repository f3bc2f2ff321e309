# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from experiments.claims.ch7_learning.constraint_discovery import (
    DISCOUNTS,
    FAILING,
    INITIAL,
    LAWS,
    PUBLISHED_LAW,
    fail,
    findings,
    numbers,
    peaks,
    plot,
    sooner,
    stochastic,
    summary,
)
from experiments.kit.learning.arm import arm_space
from mobee.errors import InvalidValue
from tests.experiments.finished_cells import Cell, finished

SPACE = arm_space()


def explored(failing: int, discount: float = 0.9):
    """Every action seven times; those that fail end where they began, and are tried `failing` times more."""
    rows = []
    for state in range(len(SPACE)):
        for action, goal in enumerate(SPACE.actions(state)):
            fails = (state, int(goal)) in FAILING
            rows += [(state, action, state if fails else int(goal))] * (7 + fails * failing)
    seen = np.array(rows, dtype=np.uint16)
    tries = np.zeros(SPACE.goals.shape, dtype=np.uint16)
    np.add.at(tries, tuple(seen[:, :2].T.astype(int)), 1)
    return summary({"seen": seen, "tries": tries, "values": np.where(SPACE.goals >= 0, discount, -np.inf)})


def every_setting(work):
    return finished(
        work,
        [
            Cell(f"{n}-{i}-{d}-{s}", s, {"law": law, "initial": i, "discount": d, "least": 5})
            for (n, law), i, d, s in product(enumerate(LAWS), INITIAL, DISCOUNTS, range(2))
        ],
    )


def test_tries_and_failures_decide_the_claims():
    results = findings(every_setting(lambda cell: explored(40 if cell.settings["initial"] == "60-40" else 0)))
    verdicts = {claim["text"]: claim["verdict"] for claim in results["claims"]}
    expected = {numbers[0]: "confirmed", sooner: "refuted", fail: "confirmed", peaks: "confirmed", stochastic: "refuted"}
    assert {claim: verdicts[claim.text] for claim in expected} == expected  # 3024 actions, and 60-40 needs more


def test_claims_stay_open_while_settings_were_not_run():
    results = findings(
        finished(lambda cell: explored(0), [Cell("a", 0, {"law": PUBLISHED_LAW, "initial": "50-50", "discount": 0.9, "least": 5})])
    )
    assert {claim["verdict"] for claim in results["claims"]} == {"open"}
    assert results["runs"]["as published, 50-50, discount 0.9"]["failing_actions_fail"] == 1.0


def test_without_a_finished_run_of_the_published_law_there_is_no_figure():
    other = [Cell("a", 0, {"law": [*LAWS][1], "initial": "50-50", "discount": 0.9, "least": 5})]
    with pytest.raises(InvalidValue, match="finished: continue the run with --resume"):
        plot(finished(lambda cell: explored(0), other))
