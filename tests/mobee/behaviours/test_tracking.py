# SPDX-License-Identifier: Apache-2.0
"""The motion of a target by its last places."""

from __future__ import annotations

import numpy as np
import pytest

from mobee.behaviours.tracking import JUMP, LEASH, Reference, TargetTrack
from mobee.errors import InvalidValue
from tests.mobee.control.test_slides import with_units


def test_the_place_is_extrapolated_over_the_latency(rng: np.random.Generator) -> None:
    track, velocity = TargetTrack(), np.array([0.1, -0.2, 0.05])
    for k in range(12):
        track.note(k / 15, k / 15 * velocity + 0.001 * rng.normal(size=3))
    place, moving = track.at(11 / 15 + 0.15)
    assert place == pytest.approx((11 / 15 + 0.15) * velocity, abs=0.005)
    assert moving == pytest.approx(velocity, abs=0.015)


@pytest.mark.parametrize("patience", [0.15, 0.6])
@pytest.mark.parametrize("gap", [0.1, 0.25, 0.45, 0.7])
def test_after_a_jump_the_target_rests_until_it_was_seen_to_move(gap: float, patience: float) -> None:
    """Also if it was stale before."""
    track = TargetTrack(patience)
    for k in range(8):
        track.note(k * 0.1, np.array([0.02 * k, 0.0, 0.0]))
    jumped = [0.14 + 0.2 * gap, 2.0 * JUMP, 0.0]
    track.note(0.7 + gap, np.array(jumped))
    place, moving = track.at(0.75 + gap)
    assert place.tolist() == jumped and not moving.any()


def test_a_target_that_was_not_seen_for_long_is_stale() -> None:
    track = TargetTrack(patience=0.5)
    assert track.at(0.0) is None
    track.note(1.0, np.ones(3))
    assert track.at(1.5) is not None and track.at(1.51) is None
    track.note(0.9, np.zeros(3))  # late: it changes nothing
    assert track.at(1.2)[0].tolist() == [1.0, 1.0, 1.0]
    track.forget()
    assert track.at(1.0) is None


@pytest.mark.parametrize("place", [[0.0, 1.0], [0.0, np.nan, 0.0]])
def test_a_place_that_is_none_is_refused(place: list[float]) -> None:
    with pytest.raises(InvalidValue, match="three finite numbers"):
        TargetTrack().note(0.0, np.array(place))


def test_the_patience_is_a_time() -> None:
    with pytest.raises(InvalidValue, match="patience"):
        TargetTrack(patience=0.0)


@pytest.mark.parametrize("unit", [1.0, 0.05])
def test_a_reference_waits_15_degrees_ahead_of_a_blocked_motor_in_the_unit_of_a_slide(unit: float) -> None:
    robot = with_units(np.array([unit, 1.0, 1.0]))
    (low, high), here = robot.limits[:1].T, np.zeros(1)
    reference = Reference(robot, slice(0, 1), here, low, high)
    for _ in range(200):
        reference.catch_up(high, np.zeros(1), here, 0.02)
    assert reference.q == pytest.approx([unit * LEASH])
