from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch7_learning.kail import DIVERGENCES, PARTS, failing, findings, rewards, sound, trial, tries_to_prefer
from tests.experiments.finished_cells import Cell, finished


def test_rewards_on_paper_are_those_of_the_tables():
    assert rewards("left_arm", "kail", sound, repeats=1)[0, :3] == pytest.approx([0.0201, 0.0095, 0.0052], abs=5e-5)
    assert rewards("torso", "kail", failing, repeats=1)[0, :3] == pytest.approx([0.0487, 0.0196, 0.0103], abs=5e-5)


def test_plain_kl_never_tells_a_failing_action_from_a_sound_one():
    assert tries_to_prefer("left_arm", "kail", "failing") == 1.0
    assert np.isinf(tries_to_prefer("left_arm", "kl", "failing"))


def test_short_runs_of_everybody_give_all_claims_a_number():
    cells = [
        Cell(f"{part}-{divergence}", 0, {"part": part, "divergence": divergence, "transitions": 110})
        for part in PARTS
        for divergence in DIVERGENCES
    ]
    results = findings(finished(lambda cell: trial(cell.settings, cell.seed), cells))
    assert all(claim["ours"] for claim in results["claims"])
    assert results["runs"]["left_arm, kail"]["promised_first"] == results["runs"]["torso, kail"]["promised_first"] == 0.05889
    assert results["runs"]["left_arm, kl"]["promised_first"] < results["runs"]["torso, kl"]["promised_first"]
