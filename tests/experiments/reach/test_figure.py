from __future__ import annotations

from types import SimpleNamespace

import pytest

import mobee
from experiments.kit.cells import Cell
from experiments.reach.figure import draw
from experiments.reach.runs import LOOKS
from tests.experiments.reach.test_findings import runs


def test_a_run_is_drawn(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    monkeypatch.setattr("experiments.reach.poses.HEIGHT", 40)  # small pictures take no time
    found = {}
    for strategy, mine in runs().items():
        for seed, values in enumerate(mine.values[:2]):
            cell = Cell(f"{strategy}-s{seed}", seed, {"strategy": strategy, "looks": list(LOOKS)})
            found[cell.name] = SimpleNamespace(cell=cell, values=values, seconds=1.0)
    assert draw(found, tmp_path / "reach.png").stat().st_size > 50_000


def test_nothing_is_drawn_of_a_run_that_was_stopped_before_its_first_cell(tmp_path):
    with pytest.raises(mobee.InvalidValue, match="no finished cells"):
        draw({}, tmp_path / "reach.png")
