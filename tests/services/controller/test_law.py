# SPDX-License-Identifier: Apache-2.0
"""The warm-up of the law does not change its state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mobee import Controller, Gains, Model
from services.controller.law import warm_up
from tests.services.controller.stage import ROBOT


@pytest.mark.parametrize("gains", ["default", "published_2014"])
def test_a_law_that_was_warmed_steps_as_a_new_one(gains: str) -> None:
    warmed, new = (Controller(Model(ROBOT), Gains.named(gains), "velocity") for _ in range(2))
    warm_up(warmed, ROBOT)
    q = ROBOT.home + 0.01
    for _ in range(3):
        assert np.array_equal(warmed.step(q, 0.01).velocity, new.step(q, 0.01).velocity)
    assert not warmed.reaches


def test_motors_that_the_gains_never_move_do_not_prevent_the_start() -> None:
    gains = replace(Gains.default(), weights=(("l_*", 0.0), ("r_*", 0.0)))
    warm_up(Controller(Model(ROBOT), gains, "velocity"), ROBOT)
