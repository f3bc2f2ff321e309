# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from experiments.bench.trm import LEAST_SQUARES, NES, Settings, measure, verdict
from experiments.claims.ch3_roadmaps import trm as coverage
from mobee.roadmap.building.lattice_builder import Patience


@pytest.fixture(scope="module")
def result() -> dict:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(coverage, "GENEROUS", Patience(starts=4, tries=2, scouts=64))
        patch.setattr(coverage, "RANDOM_POINTS", 20)
        return measure(Settings(spacing=0.08, seeds=2, vertices=20, methods=(LEAST_SQUARES,)))


def test_completeness_and_validity_of_a_map_are_measured(result: dict) -> None:
    row = result["rows"][LEAST_SQUARES]
    assert row["vertices"] >= 20 and row["valid"] == 1.0
    assert 0.9 < row["coverage"] <= 1.0 and 0.0 < row["largest_hole"] < 3.0
    assert 0.0 < row["short_edges"] <= 1.0 and row["processor_s"] > 0.0


def test_every_requirement_of_the_methods_asked_for_is_judged(result: dict) -> None:
    assert len(result["requirements"]) == 5
    assert result["passed"] == all(one["passed"] for one in result["requirements"])


def test_times_are_judged_as_on_the_standard_machine() -> None:
    row = {"wall_s": 100.0, "standard_wall_s": 1.0, "coverage": 1.0, "largest_hole": 1.0, "valid": 1.0, "vertices": 5000}
    assert verdict({LEAST_SQUARES: row, NES: row | {"standard_wall_s": 15.0}}, vertices=4000)["passed"]
    assert not verdict({LEAST_SQUARES: row | {"standard_wall_s": 15.0}}, vertices=4000)["passed"]
    assert not verdict({LEAST_SQUARES: row}, vertices=6000)["passed"]
