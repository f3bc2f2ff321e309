from __future__ import annotations

import argparse

import numpy as np
import pytest

from experiments import settle
from experiments.control.ride import Ride
from experiments.settle.responses import judge, motor_step, postures
from mobee import Model, UnknownName, load_robot

ICUB = load_robot("icub")
DT = 0.01
T = np.arange(DT, 6.0, DT)


def judged(response: np.ndarray, end: float = 1.0):
    q = response[:, None]
    return judge(Ride(q, np.zeros_like(q), DT), np.zeros(1), np.full(1, end), "default", 10.0, "m")


def test_of_an_exponential_approach_the_settling_time_is_three_time_constants() -> None:
    found = judged(1.0 - np.exp(-T / 0.5))
    assert found.settling == pytest.approx(0.5 * np.log(20.0), abs=2 * DT)
    assert found.overshoot == pytest.approx(0.0, abs=1e-3) and found.is_settled


def test_an_overshoot_is_told_as_a_share_of_the_step() -> None:
    found = judged(1.0 - np.exp(-T / 0.3) * np.cos(4.0 * T))
    assert 0.05 < found.overshoot < 0.3


def test_what_goes_on_oscillating_has_not_settled() -> None:
    assert not judged(1.0 + 0.2 * np.sin(10.0 * T)).is_settled


def test_where_something_holds_a_joint_back_the_error_is_told() -> None:
    assert judged(0.9 * (1.0 - np.exp(-T / 0.2))).error_deg == pytest.approx(np.rad2deg(0.1), abs=1e-3)


def test_a_step_lies_around_the_middle_of_a_range() -> None:
    elbow = ICUB.motors.index("l_elbow")
    start, end = motor_step(elbow)
    assert (start[elbow] + end[elbow]) / 2.0 == pytest.approx(ICUB.limits[elbow].mean())
    assert np.flatnonzero(start != end).tolist() == [elbow]


def test_postures_touch_nothing() -> None:
    model = Model(ICUB)
    assert all(not len(model.evaluate(q).table) for q in postures(3, seed=1))


def test_a_small_run_is_told_and_drawn_and_not_done_twice(tmp_path) -> None:
    pytest.importorskip("matplotlib")
    arguments = argparse.Namespace(gains=["default"], periods=[20.0], postures=1, motors=["l_elbow"], seed=0)
    found = settle.run(arguments, tmp_path)
    assert found["passed"] and {kind: part["steps"] for kind, part in found["default"].items()} == {
        "20 ms, motors": 1,
        "20 ms, postures": 1,
    }
    written = (tmp_path / settle.RECORDS).read_bytes()
    assert settle.run(arguments, tmp_path) == found
    assert (tmp_path / settle.RECORDS).read_bytes() == written
    assert settle.figure(tmp_path).read_bytes().startswith(b"\x89PNG")


def test_an_unknown_motor_is_refused_before_anything_is_run(tmp_path) -> None:
    arguments = argparse.Namespace(gains=["default"], periods=[20.0], postures=1, motors=["l_elbw"], seed=0)
    with pytest.raises(UnknownName, match="Did you mean 'l_elbow'"):
        settle.run(arguments, tmp_path)
    assert not list(tmp_path.iterdir())
