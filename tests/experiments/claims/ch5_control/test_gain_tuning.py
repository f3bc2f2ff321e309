# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import pytest

from experiments.claims.ch5_control import gain_tuning
from experiments.claims.ch5_control.gain_tuning import (
    EXPERIMENT,
    TUNED,
    Judged,
    gains_with,
    numbers_of,
    objective,
    read_tried,
    search,
)
from experiments.kit.control.plant_runs import icub
from mobee import Gains
from tests.experiments.options import options_of

GOOD = Judged(2.0, 0.0, 0.0, 20.0, 0.0, 0.5, 0.5, 0.5, -5.0, -5.0, 0.0, 30.0)


@pytest.fixture
def imagined(monkeypatch):
    """A robot that settles the sooner, the stiffer it is, and drives solids into each other above 150."""

    def evaluate(gains: Gains) -> Judged:
        return replace(GOOD, settling_s=300.0 / gains.stiffness, solid_mm=max(0.0, gains.stiffness - 150.0))

    monkeypatch.setattr(gain_tuning, "evaluate", evaluate)


def test_unmet_requirements_cost_and_exceeded_ones_do_not() -> None:
    assert objective(GOOD) == pytest.approx(GOOD.settling_s)
    assert objective(replace(GOOD, solid_mm=9.0)) > objective(replace(GOOD, solid_mm=3.0)) > objective(GOOD)
    assert objective(replace(GOOD, longest_ms=15.0)) > objective(GOOD)
    assert objective(replace(GOOD, clause_deg=-9.0, chatter_mm=0.0)) == objective(GOOD)


def test_the_search_begins_with_the_default_and_finds_better(imagined) -> None:
    tried = []
    for _ in search(tried, 60, seed=1):
        pass
    assert tried[0].numbers == numbers_of(Gains.default())
    best = min(tried, key=lambda one: one.objective)
    assert best.objective < tried[0].objective and best.judged.solid_mm < 5.0


def test_an_interrupted_search_continues_with_the_same_results(imagined, tmp_path) -> None:
    (tmp_path / "whole").mkdir()
    (tmp_path / "parts").mkdir()
    EXPERIMENT.method.run(options_of(EXPERIMENT, "--sets", "8", "--seed", "2"), tmp_path / "whole")
    for sets in ("3", "8"):
        EXPERIMENT.method.run(options_of(EXPERIMENT, "--sets", sets, "--seed", "2"), tmp_path / "parts")
    whole, parts = (read_tried(tmp_path / folder / gain_tuning.RECORDS) for folder in ("whole", "parts"))
    assert [list(one.numbers) for one in parts] == [list(TUNED)] * 8
    assert [[*one.numbers.values()] for one in parts] == [pytest.approx([*one.numbers.values()], rel=1e-5) for one in whole]


def test_numbers_become_gains() -> None:
    numbers = {**numbers_of(Gains.default()), "max_spring of the torso": 7.0, "damping": 33.0}
    gains = gains_with(numbers)
    assert gains.damping == 33.0
    assert gains.of_motors("max_spring", icub().robot.motors)[:3].tolist() == [7.0] * 3
