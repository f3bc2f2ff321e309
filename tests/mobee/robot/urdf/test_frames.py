# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from mobee.robot.urdf.tree import rotation_of, rpy_of

angle = st.floats(-7.0, 7.0)


@given(st.tuples(angle, angle, angle))
@example((0.3, np.pi / 2, -1.1))
@example((0.3, -np.pi / 2, 2.0))
@example((3.0, np.pi / 2 - 1e-9, 1.0))
def test_roll_pitch_and_yaw_of_any_rotation_give_it_back(rpy: tuple[float, float, float]) -> None:
    rotation = rotation_of(np.array(rpy))
    assert np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-14
    assert np.abs(rotation_of(rpy_of(rotation)) - rotation).max() < 1e-14


def test_roll_turns_first_and_about_the_fixed_axes() -> None:
    roll, pitch, yaw = (rotation_of(np.array(one)) for one in ([0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]))
    assert np.allclose(rotation_of(np.array([0.1, 0.2, 0.3])), yaw @ pitch @ roll, atol=1e-15)
    assert np.allclose(yaw @ [1, 0, 0], [np.cos(0.3), np.sin(0.3), 0])
