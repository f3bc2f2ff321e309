# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch5_control import push_disturbance
from experiments.kit.control.plant_runs import icub_at_table
from mobee.control.law import FRICTION, INERTIA
from mobee.simulation import OfflinePlant


def test_a_push_speeds_a_joint_up_as_inertia_and_friction_say() -> None:
    plant = OfflinePlant(icub_at_table())
    push = np.array([0.0, 0.0, -1.0])
    torque = plant.model.jacobian(plant.motors.q, push_disturbance.MARKER)[:3].T @ push
    before = plant.motors.q.copy()
    step = push_disturbance.ExternalPush(plant, push, 0.0, 1.0)
    step(0)
    moved = (plant.motors.q - before) / plant.dt
    elbow = plant.robot.motors.index("l_elbow")
    assert moved[elbow] == pytest.approx(torque[elbow] / FRICTION * (1.0 - np.exp(-FRICTION / INERTIA * plant.dt)))


def test_before_its_time_a_push_moves_nothing() -> None:
    plant = OfflinePlant(icub_at_table())
    before = plant.motors.q.copy()
    push_disturbance.ExternalPush(plant, np.array([0.0, 0.0, -50.0]), 1.0, 2.0)(99)
    assert np.array_equal(plant.motors.q, before)


def test_with_mobee_the_hand_comes_back_and_without_it_does_not() -> None:
    held, free = (push_disturbance.push_hand(law, "outward", 10.0, seed=0) for law in ("default", "off"))
    assert held["moved_mm"] > 20.0 and held["away_mm"] < 2.0
    assert free["away_mm"] > 20.0 and free["moved_mm"] > held["moved_mm"]
