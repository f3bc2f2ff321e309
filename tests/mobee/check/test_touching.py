# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from mobee.check import check_robot
from mobee.check.touching import touching_pairs
from mobee.errors import InvalidValue
from mobee.model import World, sphere
from mobee.model.model import Model
from mobee.robot.join import join_robots
from mobee.robot.load import load_robot
from mobee.robot.xml.write import write_xml
from tests.mobee.check.arm import arm, named
from tests.mobee.robot.robot_files import robot_file

PALM = ("<marker", '<sphere name="palm" radius="0.02"/><marker')
STONE = ('<bodypart name="arm">', '<bodypart name="arm"><sphere name="stone" radius="0.05" px="-0.4" pz="0.165"/>')
HUB = ('<bodypart name="arm">', '<bodypart name="arm"><box name="hub" width="0.02" height="0.02" depth="0.5" px="-0.02" pz="0.1"/>')
BALL = ("<marker", '<sphere name="ball" radius="0.3"/><marker')
LINK = ('<joint name="bend"', '<joint name="bend" moves="forearm"')


@pytest.mark.parametrize(("step", "clusters"), [(0.04, ["9 joints from 'm0' on are one cluster, 0.32 m long"]), (0.06, [])])
def test_a_chain_of_short_links_that_are_not_tested_is_found(tmp_path: Path, step: float, clusters: list[str]) -> None:
    head = [f'<motor name="m{k}" minPos="-90" maxPos="90"><joint y="1"><link z="{step}" radius="0.01">' for k in range(9)]
    path = robot_file(
        tmp_path, f'<bodypart name="arm"><link z="{step}" radius="0.01">', *head, *["</link></joint></motor>"] * 9, "</link></bodypart>"
    )
    robot = load_robot(path)
    found = [finding for finding in check_robot(robot) if finding.check == "long-cluster"]
    assert [(finding.severity, finding.what, finding.where) for finding in found] == [("warning", said, f"{path}:3") for said in clusters]
    curled = np.full(9, np.pi / 2.0)  # four links make a square, so that the fifth is on the first
    assert bool(Model(robot).evaluate(curled).contacts) == (not clusters)
    free = re.sub("<ignore.*cluster.*\n", "", write_xml(robot, tmp_path / "listed.xml").read_text())
    (tmp_path / "listed.xml").write_text(free)
    again = load_robot(tmp_path / "listed.xml")
    assert Model(again).evaluate(curled).contacts
    assert [finding for finding in check_robot(again) if finding.check == "long-cluster"] == []


def test_a_long_cluster_at_the_base_is_found_alone_and_in_joined_robots(tmp_path: Path) -> None:
    head = [f'<motor name="m{k}" minPos="-90" maxPos="90"><joint y="1"><link z="0.03" radius="0.01">' for k in range(7)]
    alone = load_robot(robot_file(tmp_path, '<bodypart name="arm">', *head, *["</link></joint></motor>"] * 7, "</bodypart>"))
    joined = join_robots({"": alone, "b": alone}, {"b": (np.array([1.0, 0.0, 0.0]), np.eye(3))})
    for robot, count in ((alone, 1), (joined, 2)):
        found = [finding.what for finding in check_robot(robot) if finding.check == "long-cluster"]
        assert len(found) == count and all("7 joints from " in one for one in found)


@pytest.mark.parametrize(("home", "found"), [("10", 1), ("60", 0)])
def test_solids_that_collide_at_home_are_an_error(tmp_path: Path, home: str, found: int) -> None:
    robot = arm(tmp_path, PALM, ('home="30"', f'home="{home}"'), STONE)
    findings = [finding for finding in check_robot(robot) if finding.check == "home-collision" and "'palm'" in finding.what]
    assert len(findings) == found
    assert all(finding.severity == "error" and "'stone'" in finding.what for finding in findings)


def test_solids_that_always_overlap_are_not_a_collision_at_home_but_a_pair_to_leave_out(tmp_path: Path) -> None:
    findings = check_robot(arm(tmp_path, LINK, HUB, ("<marker", '<sphere name="ball" radius="0.5"/><marker')))
    about = [finding for finding in findings if "'hub' and 'ball'" in finding.what]
    assert [finding.check for finding in about] == ["always-touching"]
    assert '<ignore first="base" second="forearm"/>' in about[0].remedy


def test_a_pair_that_is_left_out_is_no_finding(tmp_path: Path) -> None:
    ignore = ('<bodypart name="arm">', '<ignore first="base" second="forearm"/><bodypart name="arm">')
    findings = check_robot(arm(tmp_path, LINK, HUB, BALL, ignore))
    assert [finding for finding in findings if finding.check in ("always-touching", "home-collision")] == []


def beside(*shapes: str) -> tuple[str, str]:
    """Another part with these shapes beside the forearm, which at home lies between (-.2, 0, .2) and (-.37, 0, .1)."""
    motor = f'<motor name="turn" minPos="-5" maxPos="5"><joint z="1" name="turn">{"".join(shapes)}</joint></motor>'
    return "</bodypart>", f'</bodypart>\n<bodypart name="wall"><link x="-0.3" y="0.06" z="0.14">{motor}</link></bodypart>'


KNOB, HALO = '<sphere name="knob" radius="0.03"/>', '<sphere name="halo" radius="0.05" field="true"/>'


def test_fields_that_meet_at_home_push_and_are_found(tmp_path: Path) -> None:
    (finding,) = named(arm(tmp_path, beside(HALO)), "home-force")
    assert finding.what.startswith("at home fields 'fore_field' and 'halo' overlap by")


def test_a_field_that_reaches_into_another_parts_bare_solid_is_noted(tmp_path: Path) -> None:
    (finding,) = named(arm(tmp_path, beside(KNOB)), "foreign-solid")
    assert finding.severity == "note"
    assert finding.what.startswith("at home field 'fore_field' of part 'arm' reaches 30")
    assert finding.what.endswith("into solid 'knob' of 'wall'")


def test_a_field_that_touches_the_field_of_the_other_solid_is_a_home_force(tmp_path: Path) -> None:
    findings = check_robot(arm(tmp_path, beside(KNOB, HALO)))
    assert [finding.check for finding in findings] == ["home-force"]


def test_in_a_world_one_note_says_what_is_touched_at_home(tmp_path: Path) -> None:
    def notes(place: tuple[float, float, float]) -> list[str]:
        world = World()
        world.add("rock", sphere(0.05), position=place)
        return [finding.what for finding in check_robot(arm(tmp_path), world) if finding.check == "world"]

    (far,) = notes((5.0, 0.0, 0.0))
    assert far == "at home in this world of 1 object the robot touches nothing"
    (near,) = notes((-0.2, 0.0, 0.2))
    assert "touches " in near and "'upper' and 'rock' (" in near


def test_no_poses_are_refused() -> None:
    with pytest.raises(InvalidValue, match="poses=0"):
        touching_pairs(load_robot("katana"), poses=0)
