from __future__ import annotations

import numpy as np

from experiments.claims.ch7_learning.constraint_discovery import CLAIMS, DISCOUNTS, ENTERING, FAILING, INITIAL, findings
from experiments.kit.learning.arm import arm_space
from tests.experiments.finished_cells import Cell, finished

SPACE = arm_space()


def explored(failing: int, discount: float = 0.9):
    """Every action seven times, those that fail `failing` times more; they end where they began."""
    rows = []
    for state in range(len(SPACE)):
        for action, goal in enumerate(SPACE.actions(state)):
            fails = (state, int(goal)) in FAILING
            rows += [(state, action, state if fails else int(goal))] * (7 + fails * failing)
    seen = np.array(rows, dtype=np.uint16)
    tries = np.zeros(SPACE.goals.shape, dtype=np.uint16)
    np.add.at(tries, tuple(seen[:, :2].T.astype(int)), 1)
    return {"seen": seen, "tries": tries, "values": np.where(SPACE.goals >= 0, discount, -np.inf)}


def every_setting(work):
    return finished(
        work,
        [Cell(f"{i}-{d}-{s}", s, {"initial": i, "discount": d, "least": 5}) for i in INITIAL for d in DISCOUNTS for s in range(2)],
    )


def test_the_verdicts_are_those_of_the_record():
    results = findings(every_setting(lambda cell: explored(40 if cell.settings["initial"] == "60-40" else 0)))
    verdicts = {claim["text"]: claim["verdict"] for claim in results["claims"]}
    by_claim = [verdicts[claim.text] for claim in CLAIMS]
    assert by_claim[0] == "confirmed" and by_claim[2] == "refuted"  # 3024 actions, and 60-40 takes more
    assert verdicts["the actions 15->24, 42->51 and 69->78 fail: share of failures"] == "confirmed"
    assert verdicts["60-40: the failing actions into 24, 51, 78 stand out in tries at every discount"] == "confirmed"
    assert verdicts["static constraints make outcomes uncertain: some actions sometimes fail and sometimes succeed"] == "refuted"


def test_claims_stay_open_while_settings_are_missing():
    results = findings(finished(lambda cell: explored(0), [Cell("a", 0, {"initial": "50-50", "discount": 0.9, "least": 5})]))
    assert {claim["verdict"] for claim in results["claims"]} == {"open"}
    assert results["runs"]["50-50, discount 0.9"]["failing_fail"] == 1.0


def test_all_named_actions_are_in_the_lattice():
    for source, goal in (*FAILING, *ENTERING):
        assert goal in SPACE.actions(source)
