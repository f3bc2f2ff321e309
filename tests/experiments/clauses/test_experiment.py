from __future__ import annotations

import argparse

import pytest

from experiments import clauses


def test_a_small_search_is_run_told_and_drawn(tmp_path) -> None:
    pytest.importorskip("matplotlib")
    arguments = argparse.Namespace(gains=["default"], tries=2, forced_tries=2, seed=0)
    found = clauses.run(arguments, tmp_path)
    part = found["default"]["attractors"]
    assert part["tries"] == 2 and part["largest_violation_deg"] == max(part["by_clause_deg"].values())
    assert found["passed"] is (part["largest_violation_deg"] < 2.0)
    assert clauses.run(arguments, tmp_path) == found  # nothing is left to do
    assert clauses.figure(tmp_path).read_bytes().startswith(b"\x89PNG")
