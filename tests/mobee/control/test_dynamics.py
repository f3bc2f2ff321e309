# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.control.gains import Gains
from tests.mobee.control.one_law import OneLaw


def accelerated(error: float, velocity: float, force: float, gains: Gains) -> float:
    law = OneLaw(max_spring=gains.max_spring, spring_knee=gains.max_spring / gains.stiffness, damping=gains.damping)
    return float(law.step(0.01, error, force, velocity=velocity, commanded=velocity)["acceleration"])


def test_the_published_spring_by_hand() -> None:
    """1000 e / (1000/50 + |e|) deg/s^2 at e = 30 deg is 600; damping 50 a degree per second."""
    a = accelerated(np.deg2rad(30.0), np.deg2rad(2.0), 0.0, Gains.published_2014())
    assert np.rad2deg(a) == pytest.approx(600.0 - 100.0)


def test_forces_add_to_the_acceleration() -> None:
    assert accelerated(0.0, 0.0, 0.0, Gains.default()) == 0.0
    assert accelerated(0.0, 0.0, 3.0, Gains.default()) == pytest.approx(3.0)


@given(st.floats(-9.0, 9.0), st.floats(-2.0, 2.0))
def test_the_velocity_command_is_within_its_limits(wanted: float, sent: float) -> None:
    command = float(OneLaw(max_speed=1.0, max_acceleration=10.0).step(0.01, velocity=wanted, commanded=sent)["commanded"])
    assert abs(command - sent) <= 0.1 + 1e-12
    assert abs(command) <= max(1.0, abs(sent) - 0.1 + 1e-12)
    if abs(wanted) <= 1.0 and abs(wanted - sent) <= 0.1:
        assert command == pytest.approx(wanted, abs=1e-12)


@pytest.mark.parametrize(
    ("reference", "q", "velocity", "then"),
    [(0.1, 0.0, 1.0, 0.11), (0.4, 0.0, 1.0, 0.4), (0.4, 0.0, -1.0, 0.39), (-0.4, 0.0, -1.0, -0.4), (0.995, 0.9, 1.0, 1.0)],
    ids=["continues", "waits for a blocked motor", "but comes back", "the same downwards", "ends at the limit"],
)
def test_the_position_reference(reference: float, q: float, velocity: float, then: float) -> None:
    law = OneLaw(max_lead=0.3, low=-1.0, high=1.0)
    assert law.step(0.01, q, q=q, reference=reference, velocity=velocity, commanded=velocity)["reference"] == pytest.approx(then)
