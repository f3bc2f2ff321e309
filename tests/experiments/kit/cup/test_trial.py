# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("mujoco")

from experiments.kit.cup.scene import CUP
from experiments.kit.cup.trial import Trial


def test_the_hand_puts_the_cup_down_elsewhere_around_the_clutter() -> None:
    trial = Trial("map", 424)  # with something at the first place that the cameras do not see: the hand goes up again
    before = trial.plant.things[CUP].position[:2].copy()
    result = trial.run()
    assert result.done, result.why
    assert result.pre_grasp
    assert result.lifted > 0.05
    assert np.linalg.norm(trial.plant.things[CUP].position[:2] - before) > 0.05
    assert not result.knocked
