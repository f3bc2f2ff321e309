from __future__ import annotations

import argparse

import pytest

from experiments.kit.cells import Cell
from experiments.kit.sweep import Condition, Sweep, grouped, grouped_by
from mobee.errors import InvalidValue
from mobee.roadmap.ompl import OmplMissing
from tests.experiments.finished_cells import finished


def conditions(arguments):
    return [Condition("walk", {"how": "walk"}, 8.0, seeds=(9001,)), Condition("run", {"how": "run", "where": "here"})]


def trial(settings, seed):
    return {"seed": seed}


SWEEP = Sweep(conditions, trial, findings=lambda found: {"cells": len(found)}, plot=lambda found: None)


def arguments(*given: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    SWEEP.add_arguments(parser)
    return argparse.Namespace(seed=3, **vars(parser.parse_args(given)))


def test_a_condition_may_have_seeds_of_its_own():
    cells = SWEEP.cells(arguments("--seeds", "2"))
    assert [(cell.name, cell.seed, cell.cost) for cell in cells] == [("walk-s9001", 9001, 8.0), ("run-s3", 3, 1.0), ("run-s4", 4, 1.0)]


def test_a_sweep_runs_all_its_cells_and_refuses_to_draw_none(tmp_path):
    assert SWEEP.run(arguments("--seeds", "2", "--jobs", "1"), tmp_path) == {"cells": 3}
    with pytest.raises(InvalidValue, match="no finished cells"):
        SWEEP.figure(tmp_path / "empty")


def test_cells_are_grouped_by_one_setting_or_by_several_in_the_order_of_their_seeds():
    cells = [Cell(f"{a}-{b}-s{seed}", seed, {"a": a, "b": b}) for a in (1, 2) for b in (3, 4) for seed in (10, 9)]
    found = finished(lambda cell: {"seed": cell.seed}, cells)
    assert grouped(found, "a", (2, 1, 0))[2] == [{"seed": 9}, {"seed": 9}, {"seed": 10}, {"seed": 10}]
    assert {key: [one.cell.seed for one in mine] for key, mine in grouped_by(found, "a", "b").items()} == {
        (a, b): [9, 10] for a in (1, 2) for b in (3, 4)
    }


def test_a_missing_package_is_named_before_anything_is_begun(tmp_path):
    def missing():
        raise OmplMissing("not installed")

    sweep = Sweep(conditions, trial, findings=dict, plot=dict, require=missing)
    with pytest.raises(OmplMissing, match="not installed"):
        sweep.run(arguments("--seeds", "1"), tmp_path)
    assert not list(tmp_path.iterdir())
