from __future__ import annotations

import argparse

import numpy as np
import pytest

from experiments import wall
from experiments.wall import drawn, pressing

DT = 0.01


def test_a_hand_that_stops_on_its_way_is_dead_and_one_that_arrives_is_not() -> None:
    there = np.linspace(0.0, 0.2, 100)
    stopping = np.concatenate([there, np.full(80, 0.2), 0.2 + there, np.full(100, 0.4)])
    straight = np.concatenate([there, 0.2 + there, np.full(100, 0.4)])
    hands = [np.stack([way, 0.0 * way, 0.0 * way], axis=1) for way in (stopping, straight)]
    assert drawn._dead(hands[0], DT) == pytest.approx(0.3, abs=0.05)  # 0.8 s, less the window of the speed
    assert drawn._dead(hands[1], DT) == 0.0


def test_more_force_drives_a_field_deeper_into_the_table(monkeypatch) -> None:
    monkeypatch.setattr(pressing, "LEVELS", (0.0, 300.0))
    monkeypatch.setattr(pressing, "SECONDS", 2.0)
    still, pushed = pressing.press("default", "table-left-hand", 0)
    assert still.field_mm == 0.0 and pushed.field_mm > 5.0
    assert still.clause_deg < 0.0 and still.limit_deg < 0.0


def test_a_small_run_is_told_and_drawn_and_not_done_twice(tmp_path, monkeypatch) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(pressing, "LEVELS", (0.0,))
    monkeypatch.setattr(pressing, "SECONDS", 2.0)
    monkeypatch.setattr(drawn, "SECONDS", 4.0)
    arguments = argparse.Namespace(gains=["default"], walls=["chest"], targets=["in-reach"], seed=0)
    found = wall.run(arguments, tmp_path)
    assert set(found["default"]) == {"chest", "drawn: in-reach"}
    assert wall.run(arguments, tmp_path) == found
    assert wall.figure(tmp_path).read_bytes().startswith(b"\x89PNG")
