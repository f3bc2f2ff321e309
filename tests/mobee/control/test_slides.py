# SPDX-License-Identifier: Apache-2.0
"""A motor that slides is under the law of one that turns through SLIDE_RANGE, in a unit of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.arrays import Array
from mobee.control.gains import Gains
from mobee.control.law import Law, largest_step
from mobee.errors import InvalidValue
from mobee.model.model import Model
from mobee.roadmap.playback import play, timed
from mobee.robot.motor_units import SLIDE_RANGE
from mobee.robot.robot import Clause, Robot
from mobee.simulation import MotorParameters, OfflinePlant
from tests.mobee.control.two_parts import two_part_arm

BOTH = pytest.mark.parametrize("gains", [Gains.default(), Gains.published_2014()], ids=lambda g: g.law)
UNITS = np.array([1.0, 0.03, 0.4])
SEEDS = st.integers(0, 2**32 - 1)


def with_units(units: Array) -> Robot:
    """The arm with every motor of range SLIDE_RANGE times its unit; where that is not 1 it slides."""
    one, half = two_part_arm(), 0.5 * SLIDE_RANGE
    joints = tuple(replace(j, kind="revolute" if unit == 1.0 else "prismatic") for j, unit in zip(one.joints, units, strict=True))
    motors = tuple(
        replace(m, limits=unit * np.array([-half, half]), home=0.0, max_velocity=unit * 1.0, max_acceleration=unit * 10.0)
        for m, unit in zip(one.motor_table, units, strict=True)
    )
    clause = Clause("arm", np.array([[0.5, -0.4, 0.2]]) / units, np.array([0.1]))
    return replace(one, joints=joints, motor_table=motors, clauses=(clause,))


TURNING, SLIDING = with_units(np.ones(3)), with_units(UNITS)


def total(law: Law, q: Array, torque: Array) -> Array:
    found: Array = np.sum(law.forces(q, torque), axis=0)
    return found


@BOTH
@given(seed=SEEDS)
def test_all_forces_are_those_of_turning_motors_in_the_unit_of_the_slide(gains: Gains, seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, torque, client = rng.uniform(-1.9, 1.9, 3), rng.normal(size=3) * 0.01, rng.normal(size=3) * 10.0
    turning, sliding = Law(TURNING, gains), Law(SLIDING, gains)
    assert total(sliding, UNITS * q, torque / UNITS) == pytest.approx(UNITS * total(turning, q, torque), rel=1e-9, abs=1e-12)
    added = [np.zeros(3), np.zeros(3)]
    turning.add_client(client, added[0])
    sliding.add_client(UNITS * client, added[1])
    assert added[1] == pytest.approx(UNITS * added[0], rel=1e-9)


@BOTH
@given(seed=SEEDS)
def test_a_step_is_that_of_turning_motors(gains: Gains, seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, goal, force = rng.uniform(-1.7, 1.7, (3, 3))
    commands = []
    for robot, units in ((TURNING, np.ones(3)), (SLIDING, UNITS)):
        law = Law(robot, gains)
        state = law.at_rest(units * q)
        for _ in range(3):
            found = law.step(units * q, 0.01, units * goal, units * force, state)
        commands.append(found[:2] / units)
    assert commands[1] == pytest.approx(commands[0], rel=1e-9)


@BOTH
def test_the_largest_step_is_that_of_turning_motors(gains: Gains) -> None:
    assert largest_step(SLIDING, gains) == pytest.approx(largest_step(TURNING, gains))


def test_own_gains_are_in_metres_and_the_others_follow_the_range() -> None:
    gains = Gains.default().with_motors("m1", limit_width=0.002)
    assert gains.of_robot("limit_width", SLIDING) == pytest.approx([np.deg2rad(10.0), 0.002, 0.05 * 0.4 * SLIDE_RANGE])
    assert gains.of_robot("max_spring", SLIDING) == pytest.approx(gains.of_motors("max_spring", SLIDING.motors) * UNITS)
    assert gains.of_robot("damping", SLIDING).tolist() == [40.0] * 3


@pytest.mark.parametrize("span", [0.04, 0.35, 0.6])
def test_a_slide_settles_within_a_millimetre_from_5_to_95_percent_of_its_range(span: float) -> None:
    robot = replace(with_units(np.array([1.0, span / SLIDE_RANGE, 1.0])), clauses=())
    plant = OfflinePlant(Model(robot), seed=4, contact_forces=False)
    for share in (0.05, 0.5, 0.95, 0.7, 0.3, 0.05):
        target = np.array([(share - 0.5) * span, 0.0])
        outcome = plant.act("arm", target)
        assert outcome.settled
        assert abs(outcome.q[0] - target[0]) < 1e-3
        assert abs(plant.motors.q[1] - target[0]) < 1e-3


def test_a_refused_target_is_in_metres() -> None:
    plant = OfflinePlant(Model(SLIDING), contact_forces=False)
    with pytest.raises(InvalidValue, match=r"target 0\.2 m for m1: must be within -0\.05236 to 0\.05236 m$"):
        plant.begin("arm", np.array([0.2, 0.0]))


def test_play_and_noise_of_a_slide_follow_its_range_unless_given_for_each_motor() -> None:
    common = OfflinePlant(Model(SLIDING), motors=MotorParameters(backlash=0.01)).motors
    assert common.constants["half_backlash"] == pytest.approx([0.005, 0.005 * 0.25 * 0.03, 0.005 * 0.25 * 0.4])
    assert common.noise(0.02) == pytest.approx(np.deg2rad(0.1) * np.array([1.0, 0.25 * 0.03, 0.25 * 0.4]))
    own = OfflinePlant(Model(SLIDING), motors=MotorParameters(backlash=[0.01, 0.001, 0.002])).motors
    assert own.constants["half_backlash"] == pytest.approx([0.005, 0.0005, 0.001])


@pytest.mark.parametrize("home", [-1.2, -1.15, 1.0])
def test_a_robot_rests_at_a_home_in_a_limit_zone_that_ends_there(home: float) -> None:
    def drift(ends: bool) -> float:
        motor = replace(TURNING.motor_table[0], limits=np.array([-1.2, 1.0]), home=home, zone_ends_at_home=ends)
        plant = OfflinePlant(
            Model(replace(TURNING, motor_table=(motor, *TURNING.motor_table[1:]), clauses=())), seed=1, contact_forces=False
        )
        plant.controller.attractor = plant.robot.home
        plant.run(1000)
        return float(np.rad2deg(np.abs(plant.motors.q[0] - home)))

    assert drift(ends=False) > 4.0
    assert drift(ends=True) < 0.5


def test_distances_of_a_motion_count_in_the_unit_of_the_slide() -> None:
    path = np.array([[0.0, 0.0, 0.0], [0.6, -0.5, 0.4]])
    turning, sliding = (play(Model(robot), path * unit) for robot, unit in ((TURNING, np.ones(3)), (SLIDING, UNITS)))
    assert sliding.units == pytest.approx(UNITS)
    assert 0.001 < turning.lag < 0.05
    for name in ("lag", "off"):
        assert getattr(sliding, name) == pytest.approx(getattr(turning, name), abs=0.004)  # the encoder noise of slides is smaller
    last = np.abs(sliding.q[-1] - sliding.wanted[-1])
    assert sliding.missing == pytest.approx((last / UNITS).max())


@pytest.mark.parametrize("rounding", [0.0, 0.1, 1.0])
def test_the_motion_along_a_path_is_that_of_turning_motors(rounding: float) -> None:
    """Corners are rounded by an angle, which is a length for a slide: by 0.1 m, the motion would leave the path by centimetres."""
    path = np.array([[0.0, 0.0, 0.0], [0.4, 1.2, 0.0], [-0.3, 1.5, 1.6], [0.0, -SLIDE_RANGE / 2, SLIDE_RANGE / 2]])
    turning, sliding = (
        timed(TURNING, path, Gains.default(), rounding=rounding),
        timed(SLIDING, UNITS * path, Gains.default(), rounding=rounding),
    )
    assert len(sliding.times) == len(turning.times)
    for name in ("q", "velocity", "acceleration"):
        assert getattr(sliding, name) == pytest.approx(UNITS * getattr(turning, name), abs=1e-6)
    assert np.array_equal(sliding.q[[0, -1]], (UNITS * path)[[0, -1]])
