# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.reference.plant import normal
from mobee.robot.load import load_robot
from mobee.simulation import MotorParameters, Motors

ROBOT = load_robot("icub")
MOTORS = np.arange(len(ROBOT.motors))


def normals(seed: int, ticks: range, motors: np.ndarray = MOTORS) -> np.ndarray:
    """The noise that is added to the encoders if the standard deviation is 1."""
    alive = np.isin(MOTORS, motors)
    drawn = Motors(ROBOT, MotorParameters(encoder_noise=1.0), seed, np.zeros(len(MOTORS)), alive)
    return np.array([drawn.encoders(k, 0.02)[motors] for k in ticks])


@pytest.mark.parametrize(("seed", "k", "motor"), [(0, 0, 0), (7, 1, 1), (2**64 - 1, 10**9, 40)])
def test_a_normal_is_box_muller_of_splitmix(seed: int, k: int, motor: int) -> None:
    assert normals(seed, range(k, k + 1), np.array([motor]))[0, 0] == pytest.approx(normal(seed, k, motor), rel=1e-15, abs=2e-15)


def test_many_normals_are_box_mullers_to_some_units_in_the_last_place() -> None:
    """Of a radius of up to 8.6."""
    expected = [[normal(5, k, motor) for motor in range(41)] for k in range(400)]
    assert np.abs(normals(5, range(400), np.arange(41)) - expected).max() < 4e-15


def test_it_is_a_pure_function_of_seed_tick_and_motor() -> None:
    assert np.array_equal(normals(3, range(50)), normals(3, range(50)))
    assert np.array_equal(normals(3, range(50))[20:, 5:9], normals(3, range(20, 50), np.arange(5, 9)))
    assert not (normals(3, range(50)) == normals(4, range(50))).any()


def test_moments_and_tails_are_those_of_a_normal() -> None:
    drawn = normals(1, range(5000)).ravel()
    n = len(drawn)
    assert abs(drawn.mean()) < 4.0 / np.sqrt(n)
    assert abs(drawn.var() - 1.0) < 4.0 * np.sqrt(2.0 / n)
    assert abs((drawn**3).mean()) < 4.0 * np.sqrt(15.0 / n)
    assert abs((drawn**4).mean() - 3.0) < 4.0 * np.sqrt(96.0 / n)
    for limit, share in ((1.0, 0.317311), (2.0, 0.0455), (3.0, 0.0026998)):
        assert abs((np.abs(drawn) > limit).mean() - share) < 4.0 * np.sqrt(share / n)


@pytest.mark.parametrize("lag", [1, 2, 7])
def test_ticks_motors_and_seeds_are_uncorrelated(lag: int) -> None:
    drawn = normals(1, range(5000))
    bound = 4.5 / np.sqrt(drawn[lag:].size)
    assert abs((drawn[lag:] * drawn[:-lag]).mean()) < bound
    assert abs((drawn[:, lag:] * drawn[:, :-lag]).mean()) < bound
    assert abs((drawn * normals(1 + lag, range(5000))).mean()) < bound
    assert abs(((drawn**2 - 1.0)[:, lag:] * (drawn**2 - 1.0)[:, :-lag]).mean()) < 2.0 * bound


def test_a_part_is_read_with_the_noise_that_the_whole_robot_is_read_with() -> None:
    robot = ROBOT
    motors = Motors(robot, MotorParameters(), seed=9, q=robot.home)
    where = robot.parts["right_arm"].slice
    assert np.array_equal(motors.encoders(4, 0.01)[where], motors.encoders(4, 0.01, where))
    expected = robot.home + np.deg2rad(0.1) * np.sqrt(2.0) * normals(9, range(4, 5))[0]
    assert motors.encoders(4, 0.01) == pytest.approx(expected, abs=1e-15)
