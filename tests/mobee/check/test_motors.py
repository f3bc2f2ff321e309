# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from mobee.check import check_robot
from mobee.robot.robot import Part
from tests.mobee.check.arm import arm, named, with_joint, with_motor


def test_a_home_outside_of_the_limits_is_an_error(tmp_path: Path) -> None:
    (finding,) = named(with_motor(arm(tmp_path), "bend", home=np.deg2rad(120.0)), "home-limits")
    assert finding.what == "motor 'bend' has its home at 120 deg (2.094 rad), outside of 10 to 100 deg"


def test_a_home_at_a_limit_is_none(tmp_path: Path) -> None:
    robot = arm(tmp_path)
    assert named(with_motor(robot, "bend", home=float(robot.motor_table[1].limits[1])), "home-limits") == []


def test_a_part_of_one_short_slide_can_be_used(tmp_path: Path) -> None:
    limits = np.array([0.0, 0.01])
    robot = arm(tmp_path)
    for name in ("pan", "bend"):
        robot = with_joint(with_motor(robot, name, limits=limits, home=0.005), name, limits=limits, kind="prismatic")
    assert [finding for finding in check_robot(robot) if finding.check == "idle-part"] == []


def test_a_motor_beyond_which_nothing_hangs_is_found(tmp_path: Path) -> None:
    tool = '<motor name="roll" minPos="-90" maxPos="90"><joint x="1"/></motor>'
    (finding,) = named(arm(tmp_path, ("<marker", f"{tool}<marker")), "idle-motor")
    assert finding.what.startswith("motor 'roll' moves nothing")


def test_a_motor_that_moves_only_a_marker_is_none(tmp_path: Path) -> None:
    tool = '<motor name="roll" minPos="-90" maxPos="90"><joint x="1"><marker name="nail"/></joint></motor>'
    assert named(arm(tmp_path, ("<marker", f"{tool}<marker")), "idle-motor") == []


def test_a_part_whose_motors_hardly_move_is_found(tmp_path: Path) -> None:
    tight = np.deg2rad([30.0, 30.5])
    robot = arm(tmp_path)
    for name in ("pan", "bend"):
        robot = with_joint(with_motor(robot, name, limits=tight, home=float(tight[0])), name, limits=tight)
    findings = [finding.what for finding in check_robot(robot) if finding.check == "idle-part"]
    assert findings == ["no agent can use part 'arm': all its motors move less than 1 deg"]


def test_a_part_without_motors_is_found(tmp_path: Path) -> None:
    robot = arm(tmp_path)
    (finding,) = named(replace(robot, parts={**robot.parts, "trunk": Part("trunk", (), 2)}), "idle-part")
    assert finding.what == "no agent can use part 'trunk': it has no motor"
