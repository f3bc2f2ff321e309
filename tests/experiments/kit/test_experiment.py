# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

import mobee
from experiments.kit.experiment import MIN_SEEDS, Claim, claim, judged, open_with_few_seeds

CLAIM = Claim("thesis 7.1", "something is so", "about 3")


@pytest.mark.parametrize(("holds", "verdict"), [(True, "confirmed"), (False, "refuted"), (None, "open")])
def test_a_measured_claim_is_confirmed_refuted_or_open(holds, verdict):
    assert CLAIM.measured("3.1 [2.9, 3.2]", holds) == Claim("thesis 7.1", "something is so", "about 3", "3.1 [2.9, 3.2]", verdict)


def test_a_record_is_read_back():
    assert Claim(**CLAIM.measured("3.1", True).record()) == CLAIM.measured("3.1", True)


def test_there_is_no_other_verdict():
    with pytest.raises(mobee.UnknownName, match="confirmed"):
        Claim("a", "b", "c", "d", "comfirmed")


def test_a_verdict_needs_enough_seeds():
    results = {"claims": [CLAIM.measured("3.1", False).record()], "runs": 7}
    few = open_with_few_seeds(results, {"seeds": MIN_SEEDS - 1})
    assert few["claims"][0]["verdict"] == "open" and few["claims"][0]["ours"] == "3.1 (4 seeds, too few for a verdict)"
    assert open_with_few_seeds(few, {"seeds": MIN_SEEDS - 1}) == few
    assert open_with_few_seeds(results, {"seeds": MIN_SEEDS}) == open_with_few_seeds(results, {}) == results


@claim("thesis 7.1", "there are enough runs", "two")
def enough(runs):
    return (f"{len(runs)} runs", len(runs) >= 2) if runs else None


def test_a_claim_is_measured_by_its_rule_from_complete_runs():
    assert [judged([enough, CLAIM], runs)[0]["verdict"] for runs in ([1, 2], [1], [])] == ["confirmed", "refuted", "open"]
    assert judged([enough, CLAIM], [1, 2]) == [enough.measured("2 runs", True).record(), CLAIM.record()]
    assert judged([enough], [1, 2], complete=False) == [enough.record()]
