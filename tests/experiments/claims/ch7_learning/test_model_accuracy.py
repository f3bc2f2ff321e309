# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch7_learning import model_accuracy
from experiments.claims.ch7_learning.model_accuracy import (
    CLAIMS,
    WALKS,
    error_curve,
    findings,
    half_space_plant,
    space_of,
    times,
    trial,
    truths,
)
from experiments.kit.learning.outcomes import model_error
from mobee import CuriousAgent
from tests.experiments.finished_cells import Cell, finished


def work(cell):
    return trial(cell.settings, cell.seed)


def half_space_cells(explorers, seeds=(1,)):
    return [Cell(f"half-space-{e}-s{seed}", seed, {"world": "half-space", "explorer": e}) for e in explorers for seed in seeds]


def test_the_errors_in_the_half_space_are_those_of_a_reference_implementation():
    results = findings(finished(work, half_space_cells(["curious", "least_tried"])))
    curious, least_tried = results["runs"]["half-space, 81 states; curious"], results["runs"]["half-space, 81 states; least tried"]
    assert curious["stochastic_actions"] == 13
    assert curious["L1_with_imagined"] == pytest.approx(0.317, abs=0.01) and curious["L1_debiased"] == pytest.approx(0.033, abs=0.005)
    assert least_tried["L1_debiased_stochastic"] > 1.4 * curious["L1_debiased_stochastic"]
    measured = {claim["text"]: claim["verdict"] for claim in results["claims"] if claim["ours"]}
    assert measured[CLAIMS[0].text] == "met" and len(measured) == 2


def test_the_error_is_that_of_the_agent_s_own_model():
    plant = half_space_plant(3)
    agent = CuriousAgent(space_of("half-space"), plant, "curious", 3)
    seen = []
    for _ in range(times("half-space")[0]):
        agent.step()
        seen.append((agent.last.s, agent.last.a, agent.last.s_next))
    curve = error_curve("half-space", plant, np.array(seen))
    assert curve[0] == pytest.approx([*model_error(agent.model, plant), *model_error(agent.model.debiased(), plant)])
    assert np.isnan(curve[1:]).all()


def test_the_true_outcomes_of_the_arm_are_those_of_all_walks(monkeypatch):
    monkeypatch.setattr(model_accuracy, "MAX_WALK", 30)
    cells = [Cell(f"truth-s{seed}", seed, {"world": "rank3", "explorer": "walk"}) for seed in WALKS]
    assert truths(finished(work, cells))["rank3"].tries.sum() == 60
