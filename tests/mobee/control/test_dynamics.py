from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee._core import ADDRESS, REAL, address, function
from mobee._core.law import MOTOR_GAINS
from mobee.control.gains import Gains

acceleration = function("law_acceleration", ADDRESS, REAL, REAL, REAL, REAL, result=REAL)
bounded = function("law_bounded", REAL, REAL, REAL, REAL, result=REAL)
led = function("law_led", ADDRESS, REAL, REAL, REAL, REAL, result=REAL)


def accelerated(error: float, velocity: float, force: float, gains: Gains) -> float:
    motor = np.zeros(1, dtype=MOTOR_GAINS)
    motor["max_spring"], motor["spring_knee"], motor["damping"] = gains.max_spring, gains.max_spring / gains.stiffness, gains.damping
    return acceleration(address(motor), 0.0, velocity, error, force)


def test_the_published_spring_by_hand() -> None:
    """1000 e / (1000/50 + |e|) deg/s^2 at e = 30 deg is 600; damping 50 a degree per second."""
    a = accelerated(np.deg2rad(30.0), np.deg2rad(2.0), 0.0, Gains.published_2014())
    assert np.rad2deg(a) == pytest.approx(600.0 - 100.0)


def test_forces_add_to_the_acceleration() -> None:
    assert accelerated(0.0, 0.0, 0.0, Gains.default()) == 0.0
    assert accelerated(0.0, 0.0, 3.0, Gains.default()) == pytest.approx(3.0)


@given(st.floats(-9.0, 9.0), st.floats(-2.0, 2.0))
def test_the_velocity_told_is_within_its_limits(wanted: float, sent: float) -> None:
    told = bounded(wanted, sent, 1.0, 0.1)
    assert abs(told - sent) <= 0.1 + 1e-12
    assert abs(told) <= max(1.0, abs(sent) - 0.1 + 1e-12)
    if abs(wanted) <= 1.0 and abs(wanted - sent) <= 0.1:
        assert told == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize(
    ("reference", "q", "velocity", "then"),
    [(0.1, 0.0, 1.0, 0.11), (0.4, 0.0, 1.0, 0.4), (0.4, 0.0, -1.0, 0.39), (-0.4, 0.0, -1.0, -0.4), (0.995, 0.9, 1.0, 1.0)],
    ids=["goes on", "waits for a blocked motor", "but comes back", "the same downwards", "ends at the limit"],
)
def test_the_position_reference(reference: float, q: float, velocity: float, then: float) -> None:
    motor = np.zeros(1, dtype=MOTOR_GAINS)
    motor["leash"], motor["low"], motor["high"] = 0.3, -1.0, 1.0
    assert led(address(motor), reference, q, velocity, 0.01) == pytest.approx(then)
