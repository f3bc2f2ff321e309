# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

import mobee
from experiments.kit.experiment import MIN_SEEDS, OUR_AIM, VERDICTS, Claim, Envelope, Experiment, Steps, claim, judged, verdict_of
from experiments.kit.rules import decides
from experiments.kit.statistics import interval
from experiments.registry import EXPERIMENTS, load_experiment
from tests.experiments.options import options_of

CLAIM = Claim("thesis 7.1", "something is so", "about 3")
FOUND = st.sampled_from([True, False, None, "stronger"])
SETTINGS = st.dictionaries(st.sampled_from(["1 cm", "3 cm", "10 cm", "30 cm"]), FOUND, min_size=1)


@pytest.mark.parametrize(("holds", "verdict"), [(True, "confirmed"), ("stronger", "stronger"), (False, "not reproduced"), (None, "open")])
def test_one_setting_confirms_or_fails_to_reproduce_but_never_refutes(holds, verdict):
    assert CLAIM.measured("3.1 [2.9, 3.2]", holds) == Claim("thesis 7.1", "something is so", "about 3", "3.1 [2.9, 3.2]", verdict)
    assert verdict_of(holds, untested=False) == verdict


@given(SETTINGS, st.booleans())
def test_only_a_failure_in_two_settings_or_more_and_in_all_of_them_refutes(holds, untested):
    verdict = verdict_of(Envelope("unit", holds), untested=untested)
    assert verdict in VERDICTS
    assert (verdict == "refuted") == (set(holds.values()) == {False} and len(holds) >= 2 and not untested)
    assert (verdict == "depends") == (False in holds.values() and bool({True, "stronger"} & set(holds.values())))
    assert (verdict == "confirmed") == (set(holds.values()) <= {True, "stronger"} and True in holds.values())
    assert (verdict == "stronger") == (set(holds.values()) == {"stronger"})


@given(SETTINGS)
def test_a_setting_that_does_not_decide_never_turns_an_open_row_into_a_verdict(holds):
    before, after = verdict_of(Envelope("unit", holds)), verdict_of(Envelope("unit", {**holds, "100 cm": None}))
    assert after == (before if before == "depends" else "open")


@given(SETTINGS)
def test_an_aim_is_met_in_every_setting_or_not_met(holds):
    verdict = verdict_of(Envelope("unit", holds), is_aim=True)
    assert verdict == ("not met" if False in holds.values() else "open" if None in holds.values() else "met")


def test_an_aim_has_its_own_verdicts():
    aim = Claim(f"thesis 9.3; {OUR_AIM}", "something is soon", "at most 3")
    assert [aim.measured("3.1", holds).verdict for holds in (True, False, None)] == ["met", "not met", "open"]


def test_a_record_is_read_back():
    for measured in (CLAIM.measured("3.1", True), CLAIM.measured("3.1", Envelope("unit", {"1 cm": True, "3 cm": False, "10 cm": False}))):
        assert Claim(**measured.record()) == measured
    assert measured.settings == "unit: holds for 1 cm; fails for 3 cm, 10 cm" and measured.verdict == "depends"


def test_there_is_no_other_verdict():
    with pytest.raises(mobee.UnknownName, match="confirmed"):
        Claim("a", "b", "c", "d", "comfirmed")


def test_a_verdict_needs_enough_repetitions():
    experiment = Experiment("", "", Steps(lambda parser: None, lambda arguments, folder: {}, lambda folder: folder), repeats="starts")
    results = {"claims": [CLAIM.measured("3.1", True).record()], "runs": 7}
    few = experiment.decided(results, {"starts": MIN_SEEDS - 1})
    assert few["claims"][0]["verdict"] == "open" and few["claims"][0]["ours"] == "3.1 (4 starts, too few for a verdict)"
    assert experiment.decided(few, {"starts": MIN_SEEDS - 1}) == few
    assert experiment.decided(results, {"starts": MIN_SEEDS}) == results
    assert [experiment.repetitions(made) for made in (1, 5, None)] == ["1 start", "5 starts", "no starts"]
    assert experiment.decided(results, {})["claims"][0]["ours"] == "3.1 (no starts, too few for a verdict)"
    short = experiment.decided(results, {"starts": MIN_SEEDS, "quick": True})["claims"][0]
    assert (short["verdict"], short["ours"]) == ("open", "3.1 (a short version, without a verdict)")


@pytest.mark.parametrize("name", [name for name in EXPERIMENTS if load_experiment(name).claims])
def test_each_experiment_with_claims_counts_its_repetitions_by_an_option(name):
    experiment = load_experiment(name)
    assert hasattr(options_of(experiment), experiment.repeats)


@claim("thesis 7.1", "there are enough runs", "two")
def enough(runs):
    return (f"{len(runs)} runs", len(runs) >= 2) if runs else None


def test_a_claim_is_measured_by_its_rule_from_complete_runs():
    assert [judged([enough, CLAIM], runs)[0]["verdict"] for runs in ([1, 2], [1], [])] == ["confirmed", "not reproduced", "open"]
    assert judged([enough, CLAIM], [1, 2]) == [enough.measured("2 runs", True).record(), CLAIM.record()]
    assert judged([enough], [1, 2], complete=False) == [enough.record()]


def test_the_settings_of_a_claim_are_judged_one_by_one_and_their_text_says_where_they_differ():
    each = Claim("thesis 8", "there are enough runs", "two", rule=enough.rule, varies="unit")
    (found,) = judged([each], {"1 cm": [1, 2], "3 cm": [1], "10 cm": [1, 2, 3]})
    assert (found["verdict"], found["ours"]) == ("depends", "2 runs; with 3 cm: 1 runs")
    assert found["settings"] == "unit: holds for 1 cm, 10 cm; fails for 3 cm"
    inner = Claim("thesis 8", "", "", rule=lambda runs: ("", Envelope("gain", runs)), varies="unit")
    (nested,) = judged([inner], {"1": {"a": True, "b": False}, "3": {"a": False, "b": False}})
    assert nested["settings"] == "unit / gain: holds for 1 / a; fails for 1 / b, 3"
    mixed = Claim("thesis 8", "", "", rule=lambda runs: ("", Envelope("gain", runs) if isinstance(runs, dict) else runs), varies="unit")
    (found,) = judged([mixed], {"1": {"a": True, "b": True}, "3": False})
    assert found["settings"] == "unit / gain: holds for 1; fails for 3"
    (same,) = judged([inner], {"1": {"a": True, "b": False}, "3": {"a": True, "b": False}})
    assert same["settings"] == "gain: holds for a; fails for b"


def test_p_is_the_smallest_rate_at_which_the_intervals_decide_the_same():
    rule = Claim("thesis 8", "the mean is above 0", "", rule=lambda values: ("", decides(interval(values), least=0.0)))
    near, far, undecided = (
        judged([rule], values)[0] for values in ([0.1, 1.0, -0.3, 0.8, 0.5, 0.6], [5.0, 6.0, 5.5, 5.2, 5.8], [-1.0, 1.0, 0.1])
    )
    assert far["p"] == 0.001 and 0.001 < near["p"] <= 0.05 and undecided["p"] == 1.0
    assert judged([enough], [1, 2])[0]["p"] is None
