from __future__ import annotations

import argparse

import numpy as np
import pytest

from experiments import reach
from experiments.kit.cells import Cell
from experiments.kit.reaching import arm
from experiments.kit.reaching.arm import reach_plant


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(reach, "learned_beliefs", lambda plant, seed: arm.learned_beliefs(plant, seed, 40))
    monkeypatch.setattr(reach, "REPETITIONS", 1)


def given(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    reach.add_arguments(parser)
    arguments = parser.parse_args(list(words))
    arguments.seed = 3
    return arguments


def test_each_strategy_runs_with_every_seed():
    cells = reach.cells(given("--seeds", "2"))
    assert [cell.name for cell in cells] == [f"{name}-s{seed}" for name in ("intrinsic", "greedy", "random") for seed in (3, 4)]
    assert all(cell.settings["looks"][-1] == 6400 and cell.settings["scale"] == 0.01 for cell in cells)
    assert {cell.settings["looks"][-1] for cell in reach.cells(given("--quick"))} == {400}


def test_a_cell_alone_decides_what_comes_of_it(short):
    cell = Cell("intrinsic-s5", 5, {"strategy": "intrinsic", "law": "published", "scale": 0.01, "looks": [4]})
    first, second = reach.work(cell), reach.work(cell)
    assert all(np.array_equal(first[name], second[name]) for name in first)
    assert first["rewards_grid"].shape == (1, 1, 27) and 0.0 < first["rewards_grid"].sum() < 27.0
    assert len(set(first["problem"].tolist())) == 4 and (first["duration"] > 2.0).all()


def test_the_law_of_a_scene_is_the_one_asked_for():
    assert reach_plant(0).settings["gains"] != reach_plant(0, "default").settings["gains"]
