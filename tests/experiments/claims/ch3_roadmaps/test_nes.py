# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.bench.nes import FUNCTIONS, STRATEGIES
from experiments.claims.ch3_roadmaps import nes
from experiments.claims.ch3_roadmaps.nes import CLAIMS, DIMENSIONS, are_complete, evaluations, findings
from experiments.kit.cells import Cell
from experiments.kit.experiment import judged
from tests.experiments.finished_cells import finished_trials
from tests.experiments.options import options_of

TASKS = [(function, d) for function in FUNCTIONS for d in DIMENSIONS]


def runs(**ratios: float):
    """Runs of six seeds with these ratios to CMA-ES on all tasks."""
    cma = 1000.0 + 10.0 * np.arange(6)
    return {(name, task): ratios.get(name, 1.0) * cma for name in STRATEGIES for task in TASKS}


def verdicts(known) -> list[str]:
    return [claim["verdict"] for claim in judged(CLAIMS, known)]


def test_a_strategy_outperforms_with_fewer_evaluations_on_one_task():
    known = runs(nes=1.1, xnes=3.0, snes=3.0)
    known["snes", TASKS[0]] /= 6.0
    better, *_ = judged(CLAIMS, known)
    assert better["verdict"] == "depends" and "holds for SNES as published" in better["settings"]
    assert verdicts(runs(nes=1.1, xnes=3.0, snes=3.0))[0] == "refuted"
    assert verdicts(runs(nes=0.9, xnes=0.9, snes=0.9))[0] == "confirmed"


def test_a_strategy_is_comparable_with_few_more_evaluations_on_the_median_task():
    _, comparable, aim = judged(CLAIMS, runs(nes=1.1, xnes=3.0, snes=1.4))
    assert comparable["verdict"] == "depends" and "fails for xNES as published" in comparable["settings"]
    assert aim["verdict"] == "not met" and verdicts(runs(nes=1.0))[1:] == ["confirmed", "met"]


def test_claims_stay_open_until_every_task_has_as_many_runs():
    known = runs()
    del known["xnes", TASKS[-1]]
    assert not are_complete(known)
    assert are_complete(runs()) and not are_complete({key: values[: 6 - (key[0] == "nes")] for key, values in runs().items()})


def test_a_quick_cell_finds_or_counts_with_all_it_had():
    quick = nes.EXPERIMENT.method.cells(options_of(nes.EXPERIMENT, "--seed", "3", "--seeds", "1", "--quick"))
    assert {cell.settings["dimensions"] for cell in quick} == {10} and len(quick) == len(FUNCTIONS) * len(STRATEGIES)
    ours = next(cell for cell in quick if cell.name == "nes-sphere-10-s3")
    hard = Cell("snes-cigar-s3", 3, {"strategy": "snes", "function": "cigar 1e6", "dimensions": 10, "most": 500})
    found = finished_trials(nes.trial, [ours, hard])
    assert found[ours.name].values["found"] and 500 < found[ours.name].values["evaluations"] < 5000
    assert not found[hard.name].values["found"] and found[hard.name].values["evaluations"] == 500
    results = findings(found)
    assert results["found"]["SNES as published"] == "0 of 1" and results["found"]["CMA-ES"] == "0 of 0"
    assert evaluations(found)["snes", ("cigar 1e6", 10)].tolist() == [500.0]


def test_finished_runs_can_be_drawn():
    pytest.importorskip("matplotlib")
    found = finished_trials(nes.trial, [Cell("a", 1, {"strategy": "nes", "function": "sphere", "dimensions": 10, "most": 200})])
    assert len(nes.plot(found).axes) == len(FUNCTIONS)
