# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.kit.control.plant_runs import place, random_posture, run_plant
from mobee import load_robot
from mobee.model.model import Model
from mobee.simulation import OfflinePlant
from tests.mobee.control.two_parts import two_part_arm


def test_a_placed_plant_stays_where_it_is() -> None:
    plant = OfflinePlant(Model(two_part_arm()))
    q = plant.robot.home + np.array([0.1, 0.5, -0.4])
    place(plant, q)
    assert run_plant(plant, 1.0).q == pytest.approx(np.tile(q, (100, 1)), abs=0.01)


def test_a_run_calls_before_each_tick_and_records_every_one() -> None:
    plant = OfflinePlant(Model(two_part_arm()), dt=0.02)
    ticks: list[int] = []
    plant.controller.set_attractor("arm", np.array([0.5, 0.0]))
    run = run_plant(plant, 0.5, ticks.append)
    assert ticks == list(range(25)) and run.q.shape == run.velocity.shape == (25, 3)
    assert run.times[-1] == pytest.approx(0.5)
    assert np.array_equal(run.last(0.1).q, run.q[-5:])
    assert run.q[-1, 1] > run.q[5, 1] > run.q[0, 1]


def test_the_motors_named_are_within_their_shares_and_the_others_at_home() -> None:
    robot = load_robot("icub")
    q = random_posture(robot, np.random.default_rng(1), {"torso": 3, "left_arm": 2}, (0.4, 0.6))
    moved = np.flatnonzero(q != robot.home)
    first = robot.parts["left_arm"].start
    assert moved.tolist() == [0, 1, 2, first, first + 1]
    low, high = robot.limits[moved].T
    share = (q[moved] - low) / (high - low)
    assert (share >= 0.4).all() and (share <= 0.6).all() and np.ptp(share) > 0.01
