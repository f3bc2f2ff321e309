from __future__ import annotations

import numpy as np
import pytest

import mobee
from experiments.identify import recording
from experiments.identify.recording import Responses, load, postures, record, save
from experiments.identify.signals import ROOM
from mobee.simulation import MotorParameters
from services.robot_sim.kinematic import KinematicBackend

ROBOT = mobee.load_robot("icub")


def test_postures_begin_at_home_and_leave_the_motor_its_room(rng):
    model = mobee.Model(ROBOT, mobee.World())
    motor = ROBOT.motor_index("l_wrist_pitch")  # which is at a limit at home
    found = postures(model, motor, 3, rng)
    low, high = ROBOT.limits[motor]
    assert np.delete(found[0], motor).tolist() == np.delete(ROBOT.home, motor).tolist()
    assert ((found[:, motor] >= low + ROOM - 1e-12) & (found[:, motor] <= high - ROOM + 1e-12)).all()
    assert not model.evaluate(found).count.any()


def test_a_recording_is_what_the_encoders_said_and_survives_its_file(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "TRAVEL", 30)
    body = KinematicBackend(ROBOT, mobee.World, MotorParameters.ideal(), seed=0)
    at = ROBOT.home[None]
    signals = np.full(20, 0.1), np.full(5, -0.1)
    motor = ROBOT.motor_index("torso_yaw")
    responses = record(body, ROBOT, motor, at, signals, repetitions=2)
    assert responses.fitted.shape == (1, 2, 20)
    assert np.diff(responses.fitted[0, 0]) == pytest.approx(0.001)
    assert np.diff(responses.held_out[0, 1]) == pytest.approx(-0.001)
    save(tmp_path / "torso_yaw.npz", responses, at, signals)
    assert [file.name for file in tmp_path.iterdir()] == ["torso_yaw.npz"]
    again, (first, second) = load(tmp_path / "torso_yaw.npz")
    assert isinstance(again, Responses)
    assert np.abs(again.fitted - responses.fitted).max() < 1e-6
    assert (first.tolist(), second.tolist()) == (signals[0].tolist(), signals[1].tolist())


def test_a_posture_that_is_not_reached_is_told(monkeypatch):
    monkeypatch.setattr(recording, "TRAVEL", 3)
    body = KinematicBackend(ROBOT, mobee.World, MotorParameters(), seed=0)
    far = ROBOT.home.copy()
    far[0] += 0.5
    with pytest.raises(mobee.MobeeError, match="torso_yaw is 2.* deg from the posture"):
        record(body, ROBOT, 0, far[None], (np.zeros(3), np.zeros(3)), 1)
