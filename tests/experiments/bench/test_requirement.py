from __future__ import annotations

import json

import pytest

from experiments.bench.verdicts import all_passed, judged, lines


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
    assert one["passed"] is passed and all_passed([one]) is passed
    assert {key: one[key] for key in bounds} == bounds
    assert "at_most" in one or "at_least" in one


def test_a_line_each_that_ends_with_the_verdict() -> None:
    name = "x" * 44
    said = lines([judged(name, 12_345.678, at_least=8.0, aim=12.0), judged("residual", 1e-12, at_most=1e-13)])
    assert max(map(len, said)) <= 80
    assert said[0].split() == [name, "12346", ">=", "8", "aim", "12", "pass"]
    assert said[1].split() == ["residual", "1e-12", "<=", "1e-13", "SHORT"]


def test_it_is_json() -> None:
    import numpy as np

    assert json.loads(json.dumps(judged("it", np.float64(1.0), at_least=0.5))) == {
        "name": "it",
        "found": 1.0,
        "at_least": 0.5,
        "passed": True,
    }
