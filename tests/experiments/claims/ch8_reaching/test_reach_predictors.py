# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from experiments.claims.ch8_reaching.reach_predictors import BETWEEN, CHECKPOINTS, CLAIMS, GRID, ORACLE, PUBLISHED, RECOMMENDED, fractions
from experiments.kit.cells import Cell
from experiments.kit.experiment import judged

SEEDS, TARGETS = 6, {GRID: 27, BETWEEN: 8}


def result(what: str, seed: int, level: float):
    checkpoints = 1 if what == ORACLE else len(CHECKPOINTS)
    values = {f"rewards_{name}": np.full((checkpoints, 5, count), level) for name, count in TARGETS.items()}
    settings = {"what": what} | ({} if what == ORACLE else {"checkpoints": list(CHECKPOINTS)})
    return SimpleNamespace(cell=Cell(f"{what}-s{seed}", seed, settings), seconds=1.0, values=values)


def found(recommended: float, published: float):
    levels = {ORACLE: 0.5, RECOMMENDED: 0.5 * recommended, PUBLISHED: 0.5 * published}
    return {one.cell.name: one for what, level in levels.items() for one in (result(what, seed, level) for seed in range(SEEDS))}


def verdicts(cells) -> list[str]:
    return [claim["verdict"] for claim in judged(CLAIMS, (fractions(cells), list(CHECKPOINTS)))]


def test_scores_are_divided_by_the_oracles():
    curves = fractions(found(0.9, 0.4))
    assert curves[RECOMMENDED, GRID] == pytest.approx(np.full((SEEDS, len(CHECKPOINTS)), 0.9))
    assert curves[PUBLISHED, BETWEEN] == pytest.approx(np.full((SEEDS, len(CHECKPOINTS)), 0.4))


def test_the_aims_decide_the_claims():
    assert verdicts(found(0.98, 0.4)) == ["met"] * 4 + ["confirmed"]
    assert verdicts(found(0.92, 0.5)) == ["met", "met", "not met", "met", "not reproduced"]
    assert verdicts(found(0.5, 0.6)) == ["not met"] * 4 + ["not reproduced"]


def test_claims_about_a_learner_that_was_not_run_stay_open():
    cells = {name: one for name, one in found(0.98, 0.5).items() if one.cell.settings["what"] != RECOMMENDED}
    assert verdicts(cells) == ["open"] * 5
