# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mobee.check import Finding, check_file, check_robot
from mobee.robot.load import load_robot
from tests.mobee.check.arm import LINE, SLIDE, arm, with_joint, with_motor
from tests.mobee.robot.urdf_files import ARM, srdf_file, urdf_file


def found(findings: list[Finding] | tuple[Finding, ...]) -> list[Finding]:
    return [finding for finding in findings if finding.check == "home-zone"]


@pytest.mark.parametrize(("home", "better"), [("12", "20"), ("100", "90"), ("10", "20")])
def test_a_home_in_a_limit_zone_is_noted_with_its_line_and_the_nearest_that_stays(tmp_path: Path, home: str, better: str) -> None:
    robot = arm(tmp_path, ('home="30"', f'home="{home}"'))
    (finding,) = found(check_robot(robot))
    assert (finding.severity, finding.where) == ("note", f"{tmp_path / 'toy.xml'}:{LINE['bend']}")
    assert finding.what == f"home lies in the limit zone of 1 motor: bend at {home} deg"
    assert f'bend home="{better}" (line {LINE["bend"]})' in finding.remedy
    assert found(check_robot(arm(tmp_path, ('home="30"', f'home="{better}"')))) == []


def test_the_nearest_home_of_a_slide_is_in_metres(tmp_path: Path) -> None:
    (finding,) = found(check_robot(arm(tmp_path, *SLIDE, ('home="0.1"', 'home="0.002"'))))
    assert finding.what == "home lies in the limit zone of 1 motor: bend at 2 mm"
    assert f'bend home="0.01" (line {LINE["bend"]})' in finding.remedy


def test_how_far_the_robot_is_pushed_is_as_much_as_it_rests_from_home(tmp_path: Path) -> None:
    (finding,) = found(check_robot(arm(tmp_path, ('home="30"', 'home="10"'))))
    assert "bend rests about 6.47 deg from it" in finding.why


def test_the_home_of_an_srdf_is_noted_with_the_line_there(tmp_path: Path) -> None:
    path = urdf_file(tmp_path, *ARM)
    srdf_file(tmp_path, '<group name="arm"><joint name="shoulder"/><joint name="elbow"/></group>', '<group_state name="home" group="arm">',
              '<joint name="elbow" value="1.95"/>', "</group_state>")  # fmt: skip
    (finding,) = found(check_file(path).findings)
    assert finding.where == f"{tmp_path / 'toy.srdf'}:4"
    assert finding.what == "home lies in the limit zone of 1 motor: elbow at 112 deg"
    assert "they rest there" in finding.why
    assert '<joint name="elbow" value="1.82547"/> (line 4)' in finding.remedy


def test_a_home_that_the_reader_chose_is_no_finding(tmp_path: Path) -> None:
    path = urdf_file(tmp_path, *(line.replace('lower="-1"', 'lower="0"') for line in ARM))
    assert load_robot(path).home[0] == pytest.approx(np.deg2rad(10.0))
    assert found(check_file(path).findings) == []


def test_the_zone_of_a_slide_is_reported_in_millimetres(tmp_path: Path) -> None:
    limits = np.array([0.0, 0.04])
    robot = with_joint(arm(tmp_path), "bend", kind="prismatic", limits=limits)
    assert found(check_robot(with_motor(robot, "bend", limits=limits, home=0.003))) == []
    (finding,) = found(check_robot(with_motor(robot, "bend", limits=limits, home=0.001)))
    assert "bend at 1 mm" in finding.what and "0.647 mm from it" in finding.why


def test_motors_without_limits_or_with_a_home_outside_are_found_elsewhere(tmp_path: Path) -> None:
    robot = with_motor(arm(tmp_path), "bend", limits=np.array([-np.inf, np.inf]))
    assert found(check_robot(with_motor(robot, "pan", home=3.0))) == []


def test_a_note_for_each_kind_of_zone(tmp_path: Path) -> None:
    robot = arm(tmp_path, ('home="30"', 'home="10"'), ('home="0"', 'home="-85"'))
    motors = (replace(robot.motor_table[0], zone_ends_at_home=True), robot.motor_table[1])
    assert len(found(check_robot(replace(robot, motor_table=motors)))) == 2
