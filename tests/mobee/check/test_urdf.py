# SPDX-License-Identifier: Apache-2.0
"""A URDF and its SRDF, checked: the lines are theirs, and so are the remedies."""

from __future__ import annotations

from pathlib import Path

import pytest

from mobee.check import Finding, check_file
from mobee.errors import InvalidValue
from mobee.robot.robot import Robot
from tests.mobee.check.arm import ARM
from tests.mobee.robot.robot_files import robot_file

URDF = """\
<robot name="toy">
 <link name="base"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
 <link name="upper"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>
 <link name="fore"><collision><geometry><sphere radius="0.06"/></geometry></collision></link>
 <joint name="pan" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.1"/><axis xyz="0 0 1"/>
  <limit lower="-90" upper="90" velocity="1" effort="1"/></joint>
 <joint name="bend" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz="0 0 0.06"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
 {}
</robot>
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "toy.urdf"


def of(path: Path, check: str) -> list[Finding]:
    return [finding for finding in check_file(path).findings if finding.check == check]


def test_an_ending_in_upper_case_causes_the_same_findings(file: Path) -> None:
    upper = file.with_suffix(".URDF")
    for path in (file, upper):
        path.write_text(URDF.format(""))
    said = [[(finding.what, finding.why, finding.remedy) for finding in check_file(path).findings] for path in (file, upper)]
    assert said[0] == said[1]


def test_limits_in_degrees_are_found_with_the_line_of_the_joint(file: Path) -> None:
    file.write_text(URDF.format(""))
    (finding,) = of(file, "joint-limits")
    assert finding.where == f"{file}:5"
    assert "joint 'pan' turns -5157 to 5157 deg" in finding.what


def test_a_pair_that_always_touches_is_left_out_in_the_srdf(file: Path) -> None:
    file.write_text(URDF.format("").replace('radius="0.06"', 'radius="0.12"'))
    (finding,) = of(file, "always-touching")
    assert finding.where == f"{file}:2"
    assert '<disable_collisions link1="base" link2="fore" reason="Default"/>' in finding.remedy
    file.with_suffix(".srdf").write_text('<robot name="toy"><disable_collisions link1="base" link2="fore" reason="Default"/></robot>')
    assert of(file, "always-touching") == []


def test_frames_of_the_base_are_a_note(file: Path) -> None:
    fixed = '<link name="plate"/><joint name="bolt" type="fixed"><parent link="base"/><child link="plate"/></joint>'
    file.write_text(URDF.format(fixed))
    assert [(finding.severity, finding.what) for finding in of(file, "marker")] == [("note", "1 marker that no motor moves: plate")]


def test_small_ranges_are_no_slip_for_a_urdf_is_read_in_radians(file: Path) -> None:
    file.write_text(URDF.format("").replace('"-90" upper="90"', '"-0.1" upper="0.1"').replace('"-2" upper="2"', '"-0.05" upper="0.05"'))
    assert of(file, "unit") == []


def test_a_robot_joined_from_a_urdf_and_xml_has_the_remedies_of_each_file(file: Path) -> None:
    plate = '<link name="plate"/><joint name="bolt" type="fixed"><parent link="base"/><child link="plate"/></joint>'
    file.write_text(URDF.format(plate).replace('"-90" upper="90"', '"-0.1" upper="0.1"'))
    arm = ARM.replace('"arm">', '"arm"><marker name="foot"/>').replace('"-90" maxPos="90" home="0"', '"-1.57" maxPos="1.57" home="1.57"')
    mixed = robot_file(file.parent, '<robot name="u" file="toy.urdf" px="2"/>', *arm.splitlines())
    found = [(finding.severity, finding.check, finding.where) for finding in check_file(mixed).findings]
    assert [one for one in found if one[1] in ("marker", "unit")] == [
        ("warning", "unit", f"{mixed}:5"),
        ("warning", "marker", f"{mixed}:3"),
        ("note", "marker", f"{file}:9"),
    ]
    (finding,) = of(mixed, "home-zone")
    assert 'pan home="0.785" (line 5)' in finding.remedy


def test_a_pair_of_two_urdfs_is_left_out_in_the_file_that_joins_them(file: Path) -> None:
    file.write_text(URDF.format(""))
    file.with_name("other.urdf").write_text(URDF.format(""))
    joined = robot_file(file.parent, '<robot name="a" file="toy.urdf"/>', '<robot name="b" file="other.urdf"/>')
    (finding,) = [finding for finding in of(joined, "always-touching") if "'a_fore' and 'b_fore'" in finding.what]
    assert finding.remedy == 'make one smaller, or leave the pair out: <ignore first="a_fore" second="b_fore"/>'


def test_a_collision_at_home_may_be_left_out_in_the_srdf(file: Path) -> None:
    file.write_text(URDF.format("").replace('"fore"><collision>', '"fore"><collision><origin xyz="0 0 -0.1"/>'))
    (finding,) = of(file, "home-collision")
    assert '<disable_collisions link1="base" link2="fore"' in finding.remedy


def test_a_solid_on_a_fixed_joint_is_left_out_by_its_own_link(file: Path) -> None:
    bolt = '<joint name="bolt" type="fixed"><parent link="fore"/><child link="tool"/></joint>'
    tool = '<link name="tool"><collision><geometry><sphere radius="0.12"/></geometry></collision></link>'
    file.write_text(URDF.format(bolt + tool))
    (finding,) = of(file, "always-touching")
    assert '<disable_collisions link1="base" link2="tool" reason="Default"/>' in finding.remedy
    file.with_suffix(".srdf").write_text('<robot name="toy"><disable_collisions link1="base" link2="tool" reason="Default"/></robot>')
    assert of(file, "always-touching") == []


def test_a_field_grown_inside_of_a_solid_that_has_its_own_is_a_note(file: Path) -> None:
    seed = '<collision name="seed"><geometry><sphere radius="0.01"/></geometry></collision></link>'
    file.write_text(
        URDF.format("").replace('radius="0.06"/></geometry></collision></link>', f'radius="0.06"/></geometry></collision>{seed}')
    )
    findings = [finding for finding in check_file(file, field=0.03).findings if finding.check == "field"]
    assert [(finding.severity, finding.what) for finding in findings] == [("note", "field 'seed_field' lies inside solid 'fore'")]


def test_fields_and_srdf_are_given_as_to_load_robot(file: Path, tmp_path: Path) -> None:
    file.write_text(URDF.format(""))
    assert [finding.what for finding in check_file(file).findings if finding.check == "field"] == ["the robot has no field"]
    assert not [finding for finding in check_file(file, field=0.03).findings if finding.check == "field"]
    other = tmp_path / "other.srdf"
    other.write_text('<robot name="toy"><group name="arm"><joint name="pan"/><joint name="bend"/></group></robot>')
    content = check_file(file, srdf=other).content
    assert isinstance(content, Robot) and list(content.parts) == ["arm"]


def test_a_world_has_no_fields_to_grow() -> None:
    with pytest.raises(InvalidValue, match=r"table.xml is a world: it is checked alone"):
        check_file("table", field=0.03)
