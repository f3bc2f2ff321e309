# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee.simulation import MotorParameters
from mobee.simulation.identified import FITTED, identified_robots, load_identified

ROBOT = mobee.load_robot("icub")


def test_the_shipped_numbers_are_those_of_the_shipped_robot():
    assert identified_robots() == ("icub",)
    found = load_identified("icub", ROBOT.motors)
    assert all(found[name].shape == (len(ROBOT.motors),) for name in FITTED)
    assert MotorParameters.identified("icub") == MotorParameters(**found)


def test_numbers_come_in_the_order_of_the_given_motors():
    motors = tuple(reversed(ROBOT.motors))
    assert load_identified("icub", motors)["lag"].tolist() == load_identified("icub")["lag"][::-1].tolist()


def test_a_robot_that_was_not_identified_is_refused_with_the_nearest():
    with pytest.raises(mobee.UnknownName, match="Did you mean 'icub'"):
        load_identified("icup")


def test_other_motors_than_the_file_has_are_refused():
    with pytest.raises(mobee.InvalidValue, match="tail"):
        load_identified("icub", (*ROBOT.motors, "tail"))


def test_an_offline_plant_runs_with_them():
    plant = mobee.OfflinePlant(mobee.Model(ROBOT, mobee.World()), motors=MotorParameters.identified("icub"))
    target = ROBOT.home[ROBOT.part("head").slice].copy()
    target[2] += 0.3
    outcome = plant.act("head", target)
    assert outcome.settled
    assert np.abs(outcome.q - target).max() < np.deg2rad(2.0)
