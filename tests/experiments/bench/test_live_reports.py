"""What the benchmarks of the live processes make of their measurements; the systems themselves run in tests/system."""

from __future__ import annotations

from dataclasses import asdict, replace

from experiments.bench import live, lockstep
from experiments.bench.agree import EXACT, TICK, compare
from mobee.store import Transition

ONE = Transition(n=1, s=0, a=3, s_next=4, reward=0.1, settled=True, duration=2.4, q=(0.1, 0.2), touched=("table",))
TWO = replace(ONE, n=2, s=4)


def test_the_same_transitions_agree_as_far_as_both_have_them() -> None:
    agreement = compare({"torso": [ONE, TWO]}, {"torso": [ONE, TWO, replace(TWO, n=3)]})
    assert (agreement.actions, agreement.worst, agreement.passed) == (2, 0.0, True)


def test_a_posture_a_little_off_is_found() -> None:
    agreement = compare({"torso": [ONE]}, {"torso": [replace(ONE, q=(0.1, 0.2 + 2 * EXACT))]})
    assert agreement.same
    assert not agreement.passed


def test_an_end_one_tick_later_and_another_touch_are_named() -> None:
    later = compare({"torso": [ONE]}, {"torso": [replace(ONE, duration=ONE.duration + TICK)]})
    assert "torso, action 1" in later.first_difference
    assert not compare({"torso": [ONE]}, {"torso": [replace(ONE, touched=())]}).passed


def test_nothing_to_compare_is_no_agreement() -> None:
    assert not compare({"torso": []}, {"torso": [ONE]}).passed


def test_the_table_of_lockstep_fits_80_columns_and_marks_what_falls_short() -> None:
    figures = {"speed": 12.0, "ticks_per_second": 600.0, "ticks": 12_000, "transitions": 40}
    met = {**asdict(lockstep.CASES[1]), **figures, "repeatable": True, "passed": True}
    runs = [met, {**met, "passed": False}, {**met, "passed": False, "repeatable": False}]
    lines = lockstep.report({"seconds": 20.0, "runs": runs, "passed": False}).splitlines()
    assert max(map(len, lines)) <= 80
    assert [line.split()[-1] for line in lines[-3:]] == ["10", "SHORT", "SPOILT"]


def test_the_table_of_the_live_chain_fits_80_columns_and_marks_what_is_late() -> None:
    ages = {"age_p50": 1.0, "age_p99": 2.0, "age_max": 12.0, "jitter_ms_p50": 0.05, "jitter_ms_p99": 10.25}
    counts = {"ticks": 30_000, "missed_ticks": 1234, "hold_ticks": 123, "late_forces": 1234, "at_most": 2.0}
    run = {"rate": 1000, **ages, **counts, "passed": True}
    lines = live.report({"backend": "kinematic", "seconds": 30.0, "runs": [run, {**run, "passed": False}], "passed": False}).splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[-1].endswith("LATE")
    assert not lines[-2].endswith("LATE")
