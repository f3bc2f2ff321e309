# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mobee.robot.load import load_robot, shipped_robots
from mobee.robot.motor_units import (
    FINE,
    LIMIT_WIDTH,
    SLIDE_RANGE,
    angle_unit,
    fine_units,
    limit_zones,
    motor_units,
    outside_zones,
    unit_name,
)
from mobee.robot.robot import Robot
from mobee.robot.xml.write import write_xml
from tests.mobee.planar import planar_arm
from tests.mobee.robot.robot_files import robot_file
from tests.mobee.robot.same_robot import assert_same_robot


def sliding(*limits: tuple[float, float]) -> Robot:
    """The planar arm with its joints as slides of these limits [m]."""
    one = planar_arm()
    joints = tuple(replace(joint, kind="prismatic", limits=np.array(ends)) for joint, ends in zip(one.joints, limits, strict=True))
    motors = tuple(replace(motor, limits=np.array(ends), home=ends[0]) for motor, ends in zip(one.motor_table, limits, strict=True))
    return replace(one, joints=joints, motor_table=motors)


def test_a_slide_counts_by_its_range_and_a_turning_motor_in_radians() -> None:
    robot = sliding((0.0, 0.04), (-0.38, 0.0), (0.0, 2.0))
    assert motor_units(robot) * SLIDE_RANGE == pytest.approx([0.04, 0.38, 2.0])
    assert fine_units(robot) == pytest.approx(FINE * motor_units(robot))
    assert motor_units(planar_arm()).tolist() == fine_units(planar_arm()).tolist() == [1.0] * 3


def test_a_motor_that_also_turns_something_counts_in_radians() -> None:
    robot = sliding((0.0, 0.04), (0.0, 0.04), (0.0, 0.04))
    mixed = replace(robot, joints=(replace(robot.joints[0], kind="revolute"), *robot.joints[1:]))
    assert motor_units(mixed)[0] == 1.0


@pytest.mark.parametrize(("unit", "end", "name"), [("deg", "90", "rad"), ("m", "0.2", "m"), ("m", "0.1", None)])
def test_a_motor_is_in_metres_if_its_slide_moves_as_far_as_it_does(tmp_path: Path, unit: str, end: str, name: str | None) -> None:
    joint = '<joint type="prismatic" z="1" minPos="0" maxPos="0.2"/>'
    motor = f'<motor name="lift" unit="{unit}" minPos="0" maxPos="{end}">{joint}</motor>'
    robot = load_robot(robot_file(tmp_path, f'<bodypart name="arm">{motor}</bodypart>'))
    assert name in (None, unit_name(robot, robot.motor_table[0]))
    assert_same_robot(robot, load_robot(write_xml(robot, tmp_path / "written.xml")))


def test_the_zone_of_a_slide_is_five_percent_of_its_range() -> None:
    robot = sliding((0.0, 0.04), (0.0, 0.35), (-1.0, 1.0))
    zones = limit_zones(robot, LIMIT_WIDTH * motor_units(robot))
    assert zones == pytest.approx(0.05 * np.ptp(robot.limits, axis=1)[:, None] * np.ones(2))


def narrowed(span: float, **change: object) -> Robot:
    one = planar_arm()
    return replace(one, motor_table=tuple(replace(motor, limits=np.array([0.0, span]), **change) for motor in one.motor_table))


def test_a_narrow_range_keeps_its_middle_half() -> None:
    assert limit_zones(narrowed(0.2, home=0.1), np.full(3, LIMIT_WIDTH)) == pytest.approx(np.full((3, 2), 0.05))


@pytest.mark.parametrize(("home", "below", "above"), [(0.0, 0.0, LIMIT_WIDTH), (0.05, 0.05, LIMIT_WIDTH), (1.97, LIMIT_WIDTH, 0.03)])
def test_a_zone_ends_at_home_where_the_motor_says_so(home: float, below: float, above: float) -> None:
    width = np.full(3, LIMIT_WIDTH)
    assert limit_zones(narrowed(2.0, home=home, zone_ends_at_home=True), width)[0] == pytest.approx([below, above])
    assert limit_zones(narrowed(2.0, home=home), width)[0].tolist() == [LIMIT_WIDTH] * 2


@pytest.mark.parametrize("name", shipped_robots())
def test_no_zone_of_a_shipped_robot_is_narrower_than_the_gains_say(name: str) -> None:
    robot = load_robot(name)
    assert (limit_zones(robot, np.full(len(robot.motors), LIMIT_WIDTH)) == LIMIT_WIDTH).all()


def test_the_nearest_place_outside_the_zones() -> None:
    assert outside_zones(0.0, np.array([0.0, 2.0]), 1.0) == pytest.approx(LIMIT_WIDTH)
    assert outside_zones(0.0, np.array([-1.0, 2.0]), 1.0) == 0.0
    assert outside_zones(0.0, np.array([-2.0, -1.9]), 1.0) == pytest.approx(-1.925)
    slide = np.array([0.0, 0.04])
    assert outside_zones(0.0, slide, angle_unit(slide, sliding=True)) == pytest.approx(0.002)


def test_a_range_of_nothing_has_a_unit() -> None:
    assert angle_unit(np.zeros(2), sliding=True) == 1.0
