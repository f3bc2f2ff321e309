# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np

from mobee.model.masses import gravity_torque
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.simulation.motors import MotorParameters
from services.robot_sim.kinematic import KinematicBackend

ROBOT = load_robot("icub")
DT = 0.01


def test_in_torque_mode_the_weight_must_be_carried_and_only_then() -> None:
    moved = {}
    for mode, torque in (("hold", None), ("torque", gravity_torque(ROBOT, ROBOT.home)), ("loose", np.zeros(41))):
        backend = KinematicBackend(ROBOT, lambda: load_world("table"), MotorParameters(), seed=0)
        for _ in range(50):
            backend.motors.command(slice(None), "hold" if mode == "hold" else "torque", torque)
            backend.step(DT)
        moved[mode] = np.abs(backend.motors.q - ROBOT.home).max()
    assert moved["hold"] == 0.0
    assert moved["torque"] < np.radians(0.01)
    assert moved["loose"] > np.radians(5.0)
