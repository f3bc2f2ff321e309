# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch3_roadmaps import ngik
from experiments.claims.ch3_roadmaps.ngik import CLAIMS, FEW, NES, RIVALS, WHOLE, XNES, Solver
from experiments.kit.experiment import judged
from tests.experiments.finished_cells import finished_trials
from tests.experiments.options import options_of

SEEDS = 6


def solver(evaluations: float, reached: float = 1.0) -> Solver:
    return Solver(np.full(SEEDS, reached), evaluations * (1.0 + 0.01 * np.arange(SEEDS)), np.full(SEEDS, 40.0))


def test_fewer_evaluations_outperform():
    rivals = {("cma", WHOLE): solver(4000.0), ("annealing", WHOLE): solver(3000.0), ("particles", WHOLE): solver(6000.0)}
    for xnes, verdict in ((2500.0, "confirmed"), (3500.0, "depends")):
        (found,) = judged(CLAIMS, rivals | {(NES, WHOLE): solver(2500.0), (XNES, WHOLE): solver(xnes)})
        assert found["verdict"] == verdict and "CMA-ES needs 1.60 x" in found["ours"]
    (slow,) = judged(CLAIMS, rivals | {(name, WHOLE): solver(5000.0) for name in (NES, XNES)})
    assert slow["verdict"] == "refuted"


def test_without_41_motors_all_is_open():
    assert judged(CLAIMS, {(name, FEW): solver(1000.0) for name in (NES, *RIVALS)}) == [claim.record() for claim in CLAIMS]


def test_a_quick_sweep_holds_every_solver_and_a_cell_solves_its_own_targets():
    quick = ngik.EXPERIMENT.method.cells(options_of(ngik.EXPERIMENT, "--seed", "5", "--seeds", "1", "--quick"))
    assert {(cell.settings["solver"], cell.settings["motors"]) for cell in quick} == {
        (name, motors) for name in (NES, *RIVALS) for motors in (FEW, WHOLE)
    }
    chosen = [cell for cell in quick if cell.name in ("nes-10-s5", "particles-10-s5")]
    found = finished_trials(ngik.trial, chosen)
    for cell in chosen:
        values = found[cell.name].values
        assert values["reached"].all() and (values["evaluations"] < 20_000).all() and len(values["ms"]) == 2
    pytest.importorskip("matplotlib")
    assert len(ngik.plot(found).axes) == 2
