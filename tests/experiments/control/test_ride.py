from __future__ import annotations

import numpy as np
import pytest

from experiments.control.ride import place, ride
from mobee.model import Model
from mobee.simulation import OfflinePlant
from tests.mobee.control.two_parts import two_part_arm


def test_a_placed_plant_stays_where_it_is() -> None:
    plant = OfflinePlant(Model(two_part_arm()))
    q = plant.robot.home + np.array([0.1, 0.5, -0.4])
    place(plant, q)
    assert ride(plant, 1.0).q == pytest.approx(np.tile(q, (100, 1)), abs=0.01)


def test_a_ride_tells_before_each_tick_and_keeps_every_one() -> None:
    plant = OfflinePlant(Model(two_part_arm()), dt=0.02)
    ticks: list[int] = []
    plant.controller.set_attractor("arm", np.array([0.5, 0.0]))
    done = ride(plant, 0.5, ticks.append)
    assert ticks == list(range(25)) and done.q.shape == done.velocity.shape == (25, 3)
    assert done.times[-1] == pytest.approx(0.5)
    assert np.array_equal(done.last(0.1).q, done.q[-5:])
    assert done.q[-1, 1] > done.q[5, 1] > done.q[0, 1]
