from __future__ import annotations

import numpy as np
import pytest

import mobee
from experiments.identify import fitting
from experiments.identify.check import check_method, known_motors, synthetic
from experiments.identify.fitting import fit, respond
from experiments.identify.signals import DT, PRELOAD, ROOM, fitted_signal, held_out_signal
from mobee.simulation import MotorParameters

ROBOT = mobee.load_robot("katana")  # few motors, quickly fitted


def test_motors_with_known_numbers_come_back():
    errors = check_method(ROBOT, postures=3, repetitions=2, seed=3)
    assert errors["passed"]
    assert errors["delay"]["largest"] < 1e-9
    assert errors["lag"]["largest"] < 1.5e-3
    assert errors["backlash"]["largest"] < 0.03
    assert errors["friction"]["largest"] < 0.04


def test_what_the_model_cannot_explain_is_told_as_misfit(rng, monkeypatch):
    monkeypatch.setattr(fitting, "LONGEST", 0.025)
    signals = fitted_signal(), held_out_signal(rng)
    known = MotorParameters(encoder_noise=0.0)
    responses = synthetic(ROBOT, known, signals, (2, 3), seed=0)
    wave = np.deg2rad(0.3) * np.sin(np.arange(len(signals[0])))
    responses[1].fitted[:] += wave
    found = fit(ROBOT, responses, signals)
    assert found.misfit[1] == pytest.approx(np.deg2rad(0.3) / np.sqrt(2.0), rel=0.05)
    assert found.chi_square[1] > 10.0
    assert np.delete(found.chi_square, 1).max() < 1.3
    assert found.noise == pytest.approx(np.deg2rad(0.1), rel=0.05)  # a misfit that comes again is no noise


def test_a_response_comes_later_by_the_delay_and_short_by_the_friction():
    signal = np.full(200, np.deg2rad(5.0))
    plain, late = (respond(ROBOT, MotorParameters(lag=0.0, delay=delay, backlash=0.0), signal)[0] for delay in (0.0, 0.03))
    assert np.abs(late[3:] - plain[:-3]).max() < 1e-12
    slowed = respond(ROBOT, MotorParameters(lag=0.0, delay=0.0, backlash=0.0, friction=np.deg2rad(2.0)), signal)[0]
    assert np.ptp(slowed) / np.ptp(plain) == pytest.approx(0.6)


@pytest.mark.parametrize("seed", range(5))
def test_no_signal_leaves_its_room_and_every_one_takes_up_the_play_first(seed):
    for signal in (fitted_signal(), held_out_signal(np.random.default_rng(seed))):
        assert np.abs(np.cumsum(signal) * DT).max() < ROOM
        assert np.cumsum(signal[:PRELOAD])[-1] * DT == pytest.approx(np.deg2rad(1.0))
        assert (signal[:PRELOAD] >= 0.0).all()


def test_known_motors_cover_those_without_friction_and_play():
    known = known_motors(41, seed=0)
    assert min(known.friction) == min(known.backlash) == 0.0
    assert np.ptp(known.lag) > 0.05
