# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from services.monitor.viewer.view import sweep


@pytest.fixture(scope="module")
def katana() -> Robot:
    return load_robot("katana")


def test_each_motor_goes_through_its_whole_range_alone(katana: Robot) -> None:
    for index, stretch in enumerate(sweep(katana)[:-1]):
        moved = np.ptp(stretch.poses, axis=0)
        assert np.flatnonzero(moved > 1e-9).tolist() == [index]
        assert moved[index] > 0.97 * np.ptp(katana.limits[index])
        assert stretch.title.startswith(f"{katana.motors[index]}: ")


def test_then_all_move_together(katana: Robot) -> None:
    together = sweep(katana)[-1]
    assert together.title == "all motors"
    assert (np.ptp(together.poses, axis=0) > 0.9 * np.ptp(katana.limits, axis=1)).all()


def test_every_stretch_begins_and_ends_at_home_and_stays_within_the_limits(katana: Robot) -> None:
    for stretch in sweep(katana):
        np.testing.assert_allclose(stretch.poses[[0, -1]], [katana.home, katana.home], atol=1e-9)
        assert (stretch.poses >= katana.limits[:, 0] - 1e-9).all()
        assert (stretch.poses <= katana.limits[:, 1] + 1e-9).all()


def test_a_motor_is_said_in_the_unit_of_its_joint(katana: Robot) -> None:
    assert [stretch.title for stretch in sweep(katana)][0].endswith("6.65 to 352.6 deg")
