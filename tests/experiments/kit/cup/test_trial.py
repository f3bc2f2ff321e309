# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mujoco")

from experiments.kit.cup.scene import CUP
from experiments.kit.cup.trial import Trial, leans


def test_the_hand_puts_the_cup_down_elsewhere() -> None:
    trial = Trial("map", 424)
    before = trial.plant.things[CUP].position[:2].copy()
    result = trial.run()
    assert result.done, result.why
    assert result.pre_grasp
    assert result.lifted > 0.05
    assert np.linalg.norm(trial.plant.things[CUP].position[:2] - before) > 0.05
    assert not result.knocked


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
