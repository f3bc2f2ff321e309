# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import pytest

from mobee.errors import UnknownName
from mobee.robot.load import load_robot
from services.robot_sim.config import Config
from services.robot_sim.make import make_backend
from services.robot_sim.strength import with_torques

ROBOT = load_robot("icub")


def test_the_first_pattern_that_matches_sets_the_largest_torque() -> None:
    weaker = with_torques(ROBOT, {"?_thumb_distal": 0.1, "?_thumb_*": 0.3})
    torques = {motor.name: motor.max_torque for motor in weaker.motor_table}
    assert (torques["r_thumb_distal"], torques["r_thumb_oppose"], torques["r_elbow"]) == (0.1, 0.3, 40.0)
    with pytest.raises(UnknownName, match="r_tumb"):
        with_torques(ROBOT, {"r_tumb_*": 0.1})


def test_physics_moves_the_robot_with_these_torques() -> None:
    pytest.importorskip("mujoco")
    config = Config(backend="mujoco", torques={"torso_pitch": 0.5})
    assert any("too weak" in note and "torso_pitch" in note for note in make_backend(config, ROBOT).notes)
