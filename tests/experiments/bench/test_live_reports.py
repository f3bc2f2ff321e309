# SPDX-License-Identifier: Apache-2.0
"""Verdicts and reports of the benchmarks of the live system on given summaries; the systems themselves run in tests/system."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from experiments.bench import live, lockstep
from experiments.bench.agree import MAX_DIFFERENCE, TICK, compare
from mobee.store import Transition

ONE = Transition(n=1, s=0, a=3, s_next=4, reward=0.1, settled=True, duration=2.4, q=(0.1, 0.2), touched=("table",))
TWO = replace(ONE, n=2, s=4)


def test_the_same_transitions_agree_as_far_as_both_have_them() -> None:
    agreement = compare({"torso": [ONE, TWO]}, {"torso": [ONE, TWO, replace(TWO, n=3)]})
    assert (agreement.actions, agreement.worst, agreement.passed) == (2, 0.0, True)


def test_a_posture_a_little_off_is_found() -> None:
    agreement = compare({"torso": [ONE]}, {"torso": [replace(ONE, q=(0.1, 0.2 + 2 * MAX_DIFFERENCE))]})
    assert agreement.same
    assert not agreement.passed


def test_an_end_one_tick_later_and_another_contact_are_reported() -> None:
    later = compare({"torso": [ONE]}, {"torso": [replace(ONE, duration=ONE.duration + TICK)]})
    assert "torso, action 1" in later.first_difference
    assert not compare({"torso": [ONE]}, {"torso": [replace(ONE, touched=())]}).passed


def test_nothing_to_compare_is_no_agreement() -> None:
    assert not compare({"torso": []}, {"torso": [ONE]}).passed


def lockstep_summary(speed: float, repeatable: bool = True) -> dict[str, Any]:
    return {
        "lockstep": {"speed": speed, "ticks": 12_000, "repeatable": repeatable},
        "agents": {"torso": {"transitions": 30}, "left_arm": {"transitions": 10}},
    }


def test_lockstep_is_judged_by_the_speed_on_the_standard_machine() -> None:
    case = lockstep.Case("kinematic", 50, least=15.0)
    slow = lockstep.judged_run(case, lockstep_summary(6.0), speed=1.0 / 3.0)
    assert slow["passed"] and slow["speed"] == 6.0 and slow["standard_speed"] == pytest.approx(18.0)
    assert slow["ticks_per_second"] == 300.0 and slow["transitions"] == 40
    assert not lockstep.judged_run(case, lockstep_summary(14.0), speed=1.0)["passed"]
    assert not lockstep.judged_run(case, lockstep_summary(30.0, repeatable=False), speed=1.0)["passed"]
    assert lockstep.judged_run(lockstep.Case("kinematic", 100), lockstep_summary(0.1), speed=1.0)["passed"]  # nothing is required


def test_the_table_of_lockstep_fits_80_columns_and_marks_failed_requirements() -> None:
    runs = [lockstep.judged_run(lockstep.CASES[1], lockstep_summary(*of_one), speed=0.5) for of_one in ((12.0,), (1.0,), (12.0, False))]
    lines = lockstep.report({"seconds": 20.0, "speed": 0.5, "runs": runs, "passed": False}).splitlines()
    assert max(map(len, lines)) <= 80
    assert [line.split()[-1] for line in lines[-4:-1]] == [f"{lockstep.CASES[1].aim:g}", "SHORT", "VARIES"]


def test_lockstep_compares_the_engines_at_each_rate() -> None:
    cases = [("pybullet", 50, 8.0), ("mujoco", 50, 12.0), ("mujoco", 100, 6.0)]
    runs = [lockstep.judged_run(lockstep.Case(name, rate), lockstep_summary(speed), speed=1.0) for name, rate, speed in cases]
    assert lockstep.engine_ratios(runs) == {50: 1.5}
    assert "MuJoCo is 1.50 x as fast as PyBullet at 50 Hz" in lockstep.report({"seconds": 20.0, "speed": 1.0, "runs": runs, "passed": True})


def live_summary(p99: float) -> dict[str, Any]:
    return {
        "command_age_ticks": {"p50": 1.0, "p99": p99, "max": 12.0},
        "services": {"controller": {"jitter_ms_p50": 0.05, "jitter_ms_p99": 10.25, "late_forces": 1234.0}},
        "ticks": 30_000,
        "missed_ticks": 1234,
        "hold_ticks": 123,
    }


@pytest.mark.parametrize(
    ("rate", "p99", "bare", "passed"),
    [
        (200, 2.0, 1.0, True),
        (200, 3.0, 1.0, False),
        (500, 3.0, 1.0, True),
        (1000, 5.0, 2.0, True),
        (1000, 6.0, 2.0, False),
        (1000, 6.0, 3.0, True),  # the bare chain is late too
        (1000, 5.0, 0.5, True),  # a better machine does not make it harder
        (2000, 99.0, 1.0, True),  # nothing is required
    ],
)
def test_live_ages_are_judged_beside_those_of_a_bare_chain(rate: int, p99: float, bare: float, passed: bool) -> None:
    assert live.judged_run(rate, live_summary(p99), bare)["passed"] is passed


def test_the_table_of_the_live_chain_fits_80_columns_and_marks_late_commands() -> None:
    runs = [live.judged_run(1000, live_summary(p99), 2.0) for p99 in (5.0, 17.0)]
    lines = live.report({"backend": "kinematic", "seconds": 30.0, "runs": runs, "passed": False}).splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[-2].endswith("LATE")
    assert not lines[-3].endswith("LATE")
