# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import importlib
import json
import re
from typing import Any

import numpy as np
import pytest

from experiments.bench.verdicts import Requirement, report_text, requirement_lines, verdict
from mobee_cli.bench import BENCHES

REQUIREMENTS = {name: getattr(importlib.import_module(f"experiments.bench.{name}"), "REQUIREMENTS", ()) for name in BENCHES}


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
    judged = verdict({"rows": {"ours": np.float64(found)}}, [Requirement("it", ("rows", "ours"), **bounds)])
    (one,) = json.loads(json.dumps(judged["requirements"]))
    assert one["passed"] is passed and {key: one[key] for key in bounds} == bounds
    assert "at_most" in one or "at_least" in one


def result_of(requirements: tuple[Requirement, ...], missed: Requirement | None) -> dict[str | int, Any]:
    """A result whose numbers are at their bounds, but for the one that is missed by a little."""
    result: dict[str | int, Any] = {}
    for one in requirements:
        *outer, last = one.keys
        place = result
        for key in outer:
            place = place.setdefault(key, {})
        bound, better = (one.at_least, 1.0) if one.at_least is not None else (one.at_most, -1.0)
        assert bound is not None
        place[last] = bound - better * 1e-3 * abs(bound) * (one is missed)
    return result


@pytest.mark.parametrize("name", [name for name, required in REQUIREMENTS.items() if required])
def test_every_requirement_of_a_benchmark_is_judged_by_itself(name: str) -> None:
    required = REQUIREMENTS[name]
    assert verdict(result_of(required, None), required)["passed"]
    assert not verdict(result_of(required, None), required, agree=False)["passed"]
    for one in required:
        found = verdict(result_of(required, missed=one), required)
        assert [each["name"] for each in found["requirements"] if not each["passed"]] == [one.name] and not found["passed"]


@pytest.mark.parametrize("name", [name for name, required in REQUIREMENTS.items() if required])
def test_times_sizes_and_errors_have_an_upper_bound_and_rates_and_shares_a_lower_one(name: str) -> None:
    for one in REQUIREMENTS[name]:
        has_upper = re.search(r", (s|ms|us|MiB)\b|, s on|NumPy's import|largest|errors|evaluations", one.name) is not None
        assert ((one.at_most is not None), (one.at_least is not None)) == (has_upper, not has_upper), one.name


def test_a_line_each_that_ends_with_the_verdict() -> None:
    name = "x" * 44
    required = [Requirement(name, ("a",), at_least=8.0, aim=12.0), Requirement("residual", ("b",), at_most=1e-13)]
    result = verdict({"a": 12_345.678, "b": 1e-12}, required)
    lines = requirement_lines(result["requirements"])
    assert max(map(len, lines)) <= 80
    assert [line.split() for line in lines] == [
        [name, "12346", ">=", "8", "aim", "12", "pass"],
        ["residual", "1e-12", "<=", "1e-13", "SHORT"],
    ]
    assert report_text(["first"], result).splitlines() == ["first", *lines]
    assert "0.33 x the standard machine" in report_text(["first"], result | {"speed": 1.0 / 3.0}).splitlines()[1]
