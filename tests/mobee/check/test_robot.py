# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from mobee.check import check_robot
from mobee.model import World, sphere
from mobee.robot.load import load_robot, shipped_robots
from tests.mobee.check.arm import arm, with_motor


def test_a_correct_arm_has_no_findings(tmp_path: Path) -> None:
    assert check_robot(arm(tmp_path)) == []


@pytest.mark.parametrize("name", shipped_robots())
def test_shipped_robots_have_nothing_but_notes(name: str) -> None:
    assert [finding for finding in check_robot(load_robot(name)) if finding.severity != "note"] == []


def test_katana_without_fields_gets_a_finding() -> None:
    assert [finding.what for finding in check_robot(load_robot("katana")) if finding.check != "home-zone"] == ["the robot has no field"]


def test_the_icubs_pelvis_is_known_to_stand_out_of_its_fields() -> None:
    said = " ".join(finding.what for finding in check_robot(load_robot("icub")))
    assert "'l_upper_arm_field' of part 'left_arm' reaches" in said
    assert "link 'root_link': root_link_3 by" in said


def test_the_findings_of_a_robot_are_repeatable() -> None:
    assert check_robot(load_robot("icub")) == check_robot(load_robot("icub"))


def test_errors_come_first(tmp_path: Path) -> None:
    robot = with_motor(arm(tmp_path, ("<marker", '<link x="-0.1" radius="0.01"/><marker')), "bend", home=3.0)
    severities = [finding.severity for finding in check_robot(robot)]
    assert severities == sorted(severities, key=["error", "warning", "note"].index)
    assert severities[0] == "error"


def test_with_a_world_a_collision_at_home_is_found(tmp_path: Path) -> None:
    world = World()
    world.add("rock", sphere(0.05), position=(-0.2, 0.0, 0.2))
    said = [finding for finding in check_robot(arm(tmp_path), world) if finding.check == "home-collision"]
    assert said
    assert all("'rock' of the world" in finding.what for finding in said)


def test_without_a_line_the_robots_name_stands_for_it(tmp_path: Path) -> None:
    robot = replace(with_motor(arm(tmp_path), "bend", home=3.0), where={})
    assert check_robot(robot)[0].where == "toy"


def test_with_a_line_it_is_named(tmp_path: Path) -> None:
    robot = replace(with_motor(arm(tmp_path), "bend", home=3.0), where={("motor", "bend"): "toy.xml:8"})
    assert check_robot(robot)[0].where == "toy.xml:8"
