# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.kit.control.measures import motor_step, postures, step_response
from experiments.kit.control.plant_runs import PlantRun, icub

DT = 0.01
T = np.arange(DT, 6.0, DT)


def judged(response: np.ndarray, end: float = 1.0):
    q = response[:, None]
    return step_response(PlantRun(q, np.zeros_like(q), DT), np.zeros(1), np.full(1, end))


def test_of_an_exponential_approach_the_settling_time_is_three_time_constants() -> None:
    found = judged(1.0 - np.exp(-T / 0.5))
    assert found.settling == pytest.approx(0.5 * np.log(20.0), abs=2 * DT)
    assert found.overshoot == pytest.approx(0.0, abs=1e-3) and found.is_settled


def test_an_overshoot_is_measured_as_a_share_of_the_step() -> None:
    found = judged(1.0 - np.exp(-T / 0.3) * np.cos(4.0 * T))
    assert 0.05 < found.overshoot < 0.3


def test_a_continuing_oscillation_has_not_settled() -> None:
    assert not judged(1.0 + 0.2 * np.sin(10.0 * T)).is_settled


def test_where_something_holds_a_joint_back_the_error_is_measured() -> None:
    assert judged(0.9 * (1.0 - np.exp(-T / 0.2))).error_deg == pytest.approx(np.rad2deg(0.1), abs=1e-3)


def test_a_step_is_around_the_middle_of_a_range() -> None:
    elbow = icub().robot.motors.index("l_elbow")
    start, end = motor_step(elbow)
    assert (start[elbow] + end[elbow]) / 2.0 == pytest.approx(icub().robot.limits[elbow].mean())
    assert np.flatnonzero(start != end).tolist() == [elbow]


def test_postures_touch_nothing() -> None:
    assert all(not len(icub().evaluate(q).table) for q in postures(3, seed=1))
