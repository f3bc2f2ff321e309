# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mobee.control import Forces, Gains
from mobee.control.law import Law
from mobee.robot.load import load_robot

ICUB = load_robot("icub")


def test_only_active_motors_with_weight_move_and_only_active_motors_have_forces() -> None:
    arm = ICUB.part("left_arm")
    alive = np.zeros(len(ICUB.motors), dtype=bool)
    alive[arm.slice] = True
    law = Law(ICUB, Gains.published_2014(), alive=alive)
    assert (len(law.active), len(law.live)) == (7, 16)
    beyond = ICUB.limits[:, 1] + 0.1
    forces = Forces(*law.forces(beyond, np.ones(len(beyond))))
    assert np.all(forces.limits[alive] < 0) and not forces.limits[~alive].any()
    assert forces.constraints[alive].any()
    assert np.all(forces.collision[alive] > 0) and not forces.collision[~alive].any()
    state = law.at_rest(beyond)
    law.step(beyond, 0.01, ICUB.home, forces.limits, state)
    assert np.flatnonzero(state["velocity"]).tolist() == list(range(arm.start, arm.start + 7))


def test_the_reference_of_a_motor_that_is_never_moved_is_within_its_limits() -> None:
    law = Law(ICUB, replace(Gains.default(), weights=(("*", 0.0),)))
    state = law.at_rest(ICUB.limits[:, 1] + 0.1)
    assert state["reference"] == pytest.approx(ICUB.limits[:, 1])


def test_all_that_the_default_law_pulls_with_together_is_weaker_than_a_limit() -> None:
    gains = Gains.default()
    spring, client, limit = (gains.of_motors(name, ICUB.motors) for name in ("max_spring", "max_client", "max_limit"))
    assert (spring + 2.0 * client < limit).all()  # f_config and f_work are bounded each by itself
