# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mobee.check import check_robot
from tests.mobee.check.arm import arm, named, with_joint, with_motor


def test_a_joint_without_limits_is_an_error(tmp_path: Path) -> None:
    endless = np.array([-np.inf, np.inf])
    (finding,) = named(with_motor(with_joint(arm(tmp_path), "pan", limits=endless), "pan", limits=endless), "joint-limits")
    assert finding.severity == "error"
    assert finding.what.startswith("joint 'pan' has no limits")


def test_an_empty_interval_is_an_error(tmp_path: Path) -> None:
    robot = with_joint(arm(tmp_path), "pan", limits=np.array([0.5, 0.5]))
    robot = with_motor(robot, "pan", joints=((0, 1e-12, 0.5),))
    (finding,) = named(robot, "joint-limits")
    assert "empty range 28.65 to 28.65 deg" in finding.what


@pytest.mark.parametrize(("turns", "found"), [(1.0, 0), (1.5, 1)])
def test_more_than_a_turn_to_a_side_is_a_slip_of_unit(tmp_path: Path, turns: float, found: int) -> None:
    limits = 2 * np.pi * turns * np.array([-1.0, 1.0])
    robot = with_motor(with_joint(arm(tmp_path), "pan", limits=limits), "pan", limits=limits)
    assert len(named(robot, "joint-limits")) == found


def test_a_coupled_joint_driven_beyond_its_limits_is_found(tmp_path: Path) -> None:
    (finding,) = named(with_motor(arm(tmp_path), "bend", joints=((1, 2.0, 0.0),)), "coupling")
    assert finding.what == "joint 'bend' is driven to 20 to 200 deg, beyond its own limits 10 to 100 deg"
    assert "nothing stops bend there" in finding.why


def test_two_motors_of_one_joint_are_added(tmp_path: Path) -> None:
    robot = with_motor(arm(tmp_path), "pan", joints=((0, 1.0, 0.0), (1, 0.5, 0.0)))
    (finding,) = named(robot, "coupling")
    assert finding.what.startswith("joint 'bend' is driven to -35 to 145 deg")


def test_a_joint_that_nothing_drives_is_found(tmp_path: Path) -> None:
    robot = arm(tmp_path)
    robot = replace(robot, motor_table=(replace(robot.motor_table[0], joints=((0, 1.0, 0.0),)), replace(robot.motor_table[1], joints=())))
    findings = [finding for finding in check_robot(robot) if finding.check == "coupling"]
    assert [finding.what for finding in findings] == ["no motor drives joint 'bend'"]
