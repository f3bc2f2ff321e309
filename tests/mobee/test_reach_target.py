# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee import InvalidValue, MobeeError, ReachTarget
from mobee.reach import reward_of


def test_a_target_says_how_much_is_missing() -> None:
    place = np.array([-0.3, 0.1, 0.2])
    assert ReachTarget(place).missing(place + [0.0, 0.0, 0.08]) == pytest.approx(0.08)
    assert ReachTarget(place, aim="surface").missing(place + [0.0, 0.0, 0.08]) == pytest.approx(0.03)
    assert ReachTarget(place, aim="surface").missing(place) == 0.0


@pytest.mark.parametrize("bad", [[0.1, 0.2], [0.0, np.nan, 0.0], [np.inf, 0.0, 0.0], "here", None], ids=str)
def test_an_invalid_place_is_refused(bad: object) -> None:
    with pytest.raises(InvalidValue, match="three finite numbers"):
        ReachTarget(bad)  # type: ignore[arg-type]  # the test is about wrong types


@pytest.mark.parametrize("far", [1.1e3, -1e160, 1e300], ids=str)
def test_a_place_farther_than_anything_is_refused(far: float) -> None:
    with pytest.raises(InvalidValue, match="within 1000 m"):
        ReachTarget(np.array([0.0, far, 0.0]))


def test_a_radius_a_normal_or_an_aim_that_is_none_is_refused() -> None:
    for bad in ({"radius": 0.0}, {"radius": np.nan}, {"radius": "5 cm"}, {"radius": 1e200}, {"normal": [0.0, 0.0, 0.0]}, {"aim": "middle"}):
        with pytest.raises(MobeeError):
            ReachTarget(np.zeros(3), **bad)


def test_the_reward_falls_with_the_distance_in_units_of_the_scale() -> None:
    """Thesis eq. 8.4."""
    assert reward_of(0.0) == 1.0
    assert reward_of(0.01) == pytest.approx(0.5)
    assert reward_of(0.09) == pytest.approx(0.1)
    assert reward_of(1.0, scale=1.0) == 0.5


def test_a_marker_either_faces_the_target_or_has_a_normal() -> None:
    with pytest.raises(InvalidValue, match="not both"):
        ReachTarget(np.zeros(3), normal=np.array([0.0, 0.0, 1.0]), faces=True)


def test_a_negative_zero_is_the_same_position() -> None:
    assert ReachTarget(np.array([0.3, -0.0, 0.5])).position.tobytes() == ReachTarget(np.array([0.3, 0.0, 0.5])).position.tobytes()


@pytest.mark.parametrize("size", [1e-320, 1e-200, 1.0, 1e200, 1e308])
def test_a_normal_of_any_length_is_scaled_to_1(size: float) -> None:
    assert ReachTarget(np.zeros(3), normal=size * np.array([0.0, 1.0, -1.0])).normal == pytest.approx(
        [0.0, np.sqrt(0.5), -np.sqrt(0.5)], rel=1e-3
    )
