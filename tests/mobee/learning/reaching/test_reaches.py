# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import InvalidValue, UnknownName
from mobee.learning.lattice import Lattice
from mobee.learning.reaching.reaches import hands_of, reaches_of
from mobee.model.model import Model
from mobee.robot.load import load_robot

ROBOT = load_robot("icub")
ARM = Lattice(ROBOT, ["r_shoulder_pitch", "r_shoulder_roll", "r_shoulder_yaw", "r_elbow"])


def test_the_marker_is_where_the_model_puts_it():
    hands = hands_of(ARM, "right_palm")
    assert hands.shape == (81, 3)
    for state in (0, 40, 77):
        q = ROBOT.home.copy()
        q[ROBOT.part("right_arm").slice] = ARM.target(state)
        assert hands[state] == pytest.approx(Model(ROBOT).evaluate(q).position("right_palm"), abs=1e-12)


def test_the_jacobians_are_the_derivatives_of_the_marker_s_position():
    reaches, step, state = reaches_of(ARM, "right_palm"), 1e-6, 40
    q = np.tile(ROBOT.home, (2, 1))
    q[:, ROBOT.part("right_arm").slice] = ARM.target(state)
    for joint, name in enumerate(ARM.joints):
        turned = q.copy()
        turned[:, ROBOT.motor_index(name)] += step, -step
        ends = Model(ROBOT).evaluate(turned).position("right_palm")
        assert reaches.jacobians[state, :, joint] == pytest.approx((ends[0] - ends[1]) / (2.0 * step), abs=1e-7)
    np.testing.assert_array_equal(reaches.hands, hands_of(ARM, "right_palm"))


def test_a_marker_of_another_part_is_refused():
    with pytest.raises(InvalidValue, match="right_arm carries"):
        hands_of(ARM, "left_palm")
    with pytest.raises(UnknownName, match="right_palm"):
        hands_of(ARM, "right_plam")
    assert np.isfinite(hands_of(Lattice(ROBOT, ["torso_yaw", "torso_pitch"], neighbours=8), "left_palm")).all()
