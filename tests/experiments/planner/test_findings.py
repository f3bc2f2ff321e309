from __future__ import annotations

import pytest

from experiments.kit.cells import Cell, load_cells, write_cell
from experiments.planner.findings import ENTERS, ROADMAPS, claims, summary

AFTER = [0, 1000]


def means(success, touched=0.2):
    return {
        "success": success,
        "actions": 5.0 - 2.0 * success,
        "touched": touched,
        "met": touched,
        "promised": 0.9,
        "kept": 0.9,
        "through": 0.3,
    }


def in_worlds(success, touched):
    return {test: means(success, touched) for test in ("down", "moving", "up")}


@pytest.fixture
def done(tmp_path):
    """Four seeds in which learning with the moving table saves touches, and a roadmap that is repaired works."""
    for seed in range(4):
        fates = {"tried": 100, "goal": 90, "elsewhere": 6, "sometimes": 4}
        written = {
            "still": {"tests": {"plans": in_worlds(0.9, 0.4 + 0.01 * seed)}, "fates": fates},
            "moving": {"tests": {"plans": in_worlds(0.97, 0.3)}, "fates": fates},
            "roadmap": {"tests": dict(zip(ROADMAPS, (in_worlds(0.5, 0.5), in_worlds(0.95, 0.4), in_worlds(0.97, 0.3)), strict=True))},
        }
        for way, values in written.items():
            write_cell(tmp_path, Cell(f"{way}-s{seed}", seed, {"way": way}), values, 1.0)
        for forgetting in ENTERS:
            settings = {"way": "enters", "forgetting": forgetting}
            values = {"after": AFTER, "rows": [means(0.8), means(0.98)]}
            write_cell(tmp_path, Cell(f"enters-{forgetting:g}-s{seed}", seed, settings), values, 1.0)
    return load_cells(tmp_path)


def test_the_claims_follow_from_the_numbers(done):
    fig7, enters, inoperable, predictable, avoids = claims(done)
    assert [claim.verdict for claim in (fig7, enters, inoperable)] == ["confirmed", "confirmed", "refuted"]
    assert [claim.verdict for claim in (predictable, avoids)] == ["confirmed", "confirmed"]
    assert "0.50" in inoperable.ours and "0.95" in inoperable.ours
    assert "0.80" in enters.ours and "1000 transitions later" in enters.ours


def test_the_tables_have_a_row_for_each_rival_and_world_and_each_moment(done):
    tables = summary(done)
    assert len(tables["carried out"]) == (2 + len(ROADMAPS)) * 3
    assert len(tables["since the table entered"]) == len(ENTERS) * len(AFTER)
