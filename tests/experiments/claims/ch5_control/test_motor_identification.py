# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from experiments.claims.ch5_control import motor_identification_fitting, motor_identification_recording
from experiments.claims.ch5_control.motor_identification import toml_data
from experiments.claims.ch5_control.motor_identification_fitting import Fit, check_method, fit, respond, synthetic
from experiments.claims.ch5_control.motor_identification_recording import (
    DT,
    PRELOAD,
    ROOM,
    Responses,
    fitted_signal,
    held_out_signal,
    load,
    postures,
    record,
    save,
)
from mobee.simulation import MotorParameters, identified
from services.robot_sim.kinematic import KinematicBackend

ICUB, KATANA = mobee.load_robot("icub"), mobee.load_robot("katana")  # the latter has few motors, which are quickly fitted
COUNT = len(ICUB.motors)


def test_motors_with_known_numbers_come_back():
    errors = check_method(KATANA, postures=3, repetitions=2, seed=3)
    assert errors["passed"]
    assert errors["delay"]["largest"] < 1e-9
    assert errors["lag"]["largest"] < 1.5e-3
    assert errors["backlash"]["largest"] < 0.03
    assert errors["friction"]["largest"] < 0.04


def test_unexplained_residuals_are_reported_as_misfit(rng, monkeypatch):
    monkeypatch.setattr(motor_identification_fitting, "LONGEST", 0.025)
    signals = fitted_signal(), held_out_signal(rng)
    known = MotorParameters(encoder_noise=0.0)
    responses = synthetic(KATANA, known, signals, (2, 3), seed=0)
    wave = np.deg2rad(0.3) * np.sin(np.arange(len(signals[0])))
    responses[1].fitted[:] += wave
    found = fit(KATANA, responses, signals)
    assert found.misfit[1] == pytest.approx(np.deg2rad(0.3) / np.sqrt(2.0), rel=0.05)
    assert found.chi_square[1] > 10.0
    assert np.delete(found.chi_square, 1).max() < 1.3
    assert found.noise == pytest.approx(np.deg2rad(0.1), rel=0.05)  # a misfit that comes again is no noise


def test_a_response_comes_later_by_the_delay_and_short_by_the_friction():
    signal = np.full(200, np.deg2rad(5.0))
    plain, late = (respond(KATANA, MotorParameters(lag=0.0, delay=delay, backlash=0.0), signal)[0] for delay in (0.0, 0.03))
    assert np.abs(late[3:] - plain[:-3]).max() < 1e-12
    slowed = respond(KATANA, MotorParameters(lag=0.0, delay=0.0, backlash=0.0, friction=np.deg2rad(2.0)), signal)[0]
    assert np.ptp(slowed) / np.ptp(plain) == pytest.approx(0.6)


@pytest.mark.parametrize("seed", range(5))
def test_no_signal_leaves_its_room_and_every_one_takes_up_the_play_first(seed):
    for signal in (fitted_signal(), held_out_signal(np.random.default_rng(seed))):
        assert np.abs(np.cumsum(signal) * DT).max() < ROOM
        assert np.cumsum(signal[:PRELOAD])[-1] * DT == pytest.approx(np.deg2rad(1.0))
        assert (signal[:PRELOAD] >= 0.0).all()


def test_postures_begin_at_home_and_leave_the_motor_its_room(rng):
    model = mobee.Model(ICUB, mobee.World())
    motor = ICUB.motor_index("l_wrist_pitch")  # which is at a limit at home
    found = postures(model, motor, 3, rng)
    low, high = ICUB.limits[motor]
    assert np.delete(found[0], motor).tolist() == np.delete(ICUB.home, motor).tolist()
    assert ((found[:, motor] >= low + ROOM - 1e-12) & (found[:, motor] <= high - ROOM + 1e-12)).all()
    assert not model.evaluate(found).count.any()


def test_a_recording_is_the_encoder_readings_and_survives_its_file(tmp_path, monkeypatch):
    monkeypatch.setattr(motor_identification_recording, "TRAVEL", 30)
    body = KinematicBackend(ICUB, mobee.World, MotorParameters.ideal(), seed=0)
    at = ICUB.home[None]
    signals = np.full(20, 0.1), np.full(5, -0.1)
    motor = ICUB.motor_index("torso_yaw")
    responses = record(body, ICUB, motor, at, signals, repetitions=2)
    assert responses.fitted.shape == (1, 2, 20)
    assert np.diff(responses.fitted[0, 0]) == pytest.approx(0.001)
    assert np.diff(responses.held_out[0, 1]) == pytest.approx(-0.001)
    save(tmp_path / "torso_yaw.npz", responses, at, signals)
    assert [file.name for file in tmp_path.iterdir()] == ["torso_yaw.npz"]
    again, (first, second) = load(tmp_path / "torso_yaw.npz")
    assert isinstance(again, Responses)
    assert np.abs(again.fitted - responses.fitted).max() < 1e-6
    assert (first.tolist(), second.tolist()) == (signals[0].tolist(), signals[1].tolist())


def test_a_posture_that_is_not_reached_is_refused(monkeypatch):
    monkeypatch.setattr(motor_identification_recording, "TRAVEL", 3)
    body = KinematicBackend(ICUB, mobee.World, MotorParameters(), seed=0)
    far = ICUB.home.copy()
    far[0] += 0.5
    with pytest.raises(mobee.MobeeError, match="torso_yaw is 2.* deg from the start posture"):
        record(body, ICUB, 0, far[None], (np.zeros(3), np.zeros(3)), 1)


@pytest.fixture
def fitted(rng) -> Fit:
    values = {name: tuple(rng.uniform(0.01, 0.1, COUNT)) for name in ("lag", "delay", "backlash", "friction")}
    ones = np.ones(COUNT)
    deviation = dict.fromkeys(values, 0.01 * ones)
    return Fit(MotorParameters(**values), deviation, np.deg2rad(0.1) * ones, ones, 0.0 * ones, ones, 0.0 * ones)


def test_the_data_that_is_written_is_read_back(fitted, tmp_path, monkeypatch):
    (tmp_path / "icub.toml").write_text(toml_data(ICUB, fitted, seed=0))
    monkeypatch.setattr(identified, "FOLDER", tmp_path)
    found = MotorParameters.identified("icub")
    for name in ("lag", "delay", "backlash", "friction"):
        assert getattr(found, name) == pytest.approx(getattr(fitted.parameters, name), abs=6e-5), name
    assert found.encoder_noise == pytest.approx(np.deg2rad(0.1), abs=1e-6)
