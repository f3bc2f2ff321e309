# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mujoco")

from experiments.kit.cup.approaches import CUP, TOP
from experiments.kit.cup.trial import Trial, leans


def test_a_hand_closes_around_the_cup_lifts_it_and_puts_it_down_elsewhere() -> None:
    trial = Trial("map", 424)
    before = trial.plant.things[CUP].position[:2].copy()
    assert trial.scene.clutter
    result = trial.run()
    assert result.done, result.why
    assert result.pre_grasp
    assert result.distance < 0.01
    assert result.lifted > 0.05
    assert np.linalg.norm(trial.plant.things[CUP].position[:2] - before) > 0.05
    assert not result.knocked
    assert trial.plant.model.world.objects[CUP].position[2] == pytest.approx(TOP + 0.065)  # the model has not seen that it moved


def test_where_no_place_works_the_cup_is_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    trial = Trial("map", 420)
    monkeypatch.setattr(trial, "_goals", lambda thing, azimuth: [])
    before = trial.plant.things[CUP].position[:2].copy()
    result = trial.run()
    assert "it stands where it was lifted" in result.why
    cup = trial.plant.things[CUP]
    assert result.lifted > 0.05
    assert leans(cup) < np.deg2rad(5.0)
    assert np.linalg.norm(cup.position[:2] - before) < 0.03
