# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch3_roadmaps import ngik
from experiments.claims.ch3_roadmaps.ngik import CLAIMS, FEW, NES, RIVALS, WHOLE, Solver
from experiments.kit.experiment import judged
from tests.experiments.finished_cells import finished_trials
from tests.experiments.options import options_of

SEEDS = 6


def solver(evaluations: float, reached: float = 1.0) -> Solver:
    return Solver(np.full(SEEDS, reached), evaluations * (1.0 + 0.01 * np.arange(SEEDS)), np.full(SEEDS, 40.0))


def test_fewer_evaluations_outperform():
    known = {(NES, WHOLE): solver(2500.0), ("cma", WHOLE): solver(4000.0), ("annealing", WHOLE): solver(2000.0)}
    found = judged(CLAIMS, known)
    cma, annealing, particles = found[:3]
    assert (cma["verdict"], annealing["verdict"], particles["verdict"]) == ("confirmed", "refuted", "open")
    assert cma["ours"].startswith("the rival needs 1.60 x")
    assert not particles["ours"]


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
