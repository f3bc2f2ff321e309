# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import json

import numpy as np
import pytest

from experiments.bench.verdicts import Requirement, judged, report_text, requirement_lines, verdict


@pytest.mark.parametrize(
    ("found", "bounds", "passed"),
    [
        (2.0, {"at_least": 2.0}, True),
        (1.9, {"at_least": 2.0}, False),
        (2.0, {"at_most": 2.0}, True),
        (2.1, {"at_most": 2.0}, False),
        (2.5, {"at_least": 2.0, "aim": 3.0}, True),
        (float("nan"), {"at_least": 2.0}, False),
        (float("nan"), {"at_most": 2.0}, False),
    ],
)
def test_a_bound_decides_and_an_aim_does_not(found: float, bounds: dict[str, float], passed: bool) -> None:
    one = judged("it", found, **bounds)
    assert one["passed"] is passed and verdict([one])["passed"] is passed
    assert {key: one[key] for key in bounds} == bounds
    assert "at_most" in one or "at_least" in one


def test_a_line_each_that_ends_with_the_verdict() -> None:
    name = "x" * 44
    lines = requirement_lines([judged(name, 12_345.678, at_least=8.0, aim=12.0), judged("residual", 1e-12, at_most=1e-13)])
    assert max(map(len, lines)) <= 80
    assert lines[0].split() == [name, "12346", ">=", "8", "aim", "12", "pass"]
    assert lines[1].split() == ["residual", "1e-12", "<=", "1e-13", "SHORT"]


def test_a_verdict_is_json() -> None:
    assert json.loads(json.dumps(judged("it", np.float64(1.0), at_least=0.5))) == {
        "name": "it",
        "found": 1.0,
        "at_least": 0.5,
        "passed": True,
    }


def test_a_requirement_finds_its_number_in_the_result() -> None:
    result = {"rows": {"ours": {"ms": 3.0}}}
    assert Requirement("it", ("rows", "ours", "ms"), at_most=2.0, aim=1.0).judge(result) == judged("it", 3.0, at_most=2.0, aim=1.0)


def test_a_condition_that_does_not_hold_fails_the_benchmark() -> None:
    met = [judged("it", 1.0, at_least=0.5)]
    assert verdict(met, agree=True) == {"requirements": met, "agree": True, "passed": True}
    assert verdict(met, agree=False)["passed"] is False


def test_a_report_ends_with_the_machine_s_speed_and_the_requirements() -> None:
    met = verdict([judged("it", 1.0, at_least=0.5)])
    assert report_text(["first"], met).splitlines() == ["first", *requirement_lines(met["requirements"])]
    assert "0.33 x the standard machine" in report_text(["first"], met | {"speed": 1.0 / 3.0}).splitlines()[1]
