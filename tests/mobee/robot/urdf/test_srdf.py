# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from pathlib import Path

import pytest

from mobee.errors import RobotFileError, Simplified
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.urdf.read import UrdfOptions, read_urdf
from mobee.robot.urdf.write import write_urdf
from tests.mobee.robot.same_robot import assert_same_pairs
from tests.mobee.robot.urdf_files import srdf_file, urdf_file

BODY = '<link name="{0}"><collision><geometry><sphere radius="0.01"/></geometry></collision></link>'
JOINT = '<joint name="{0}" type="{1}"><parent link="{2}"/><child link="{3}"/><origin xyz="1 0 0"/><limit lower="-1" upper="1"/>{4}</joint>'
GRIPPER = (
    *(BODY.format(name) for name in ("base", "upper", "lower", "palm", "left", "right")),
    JOINT.format("shoulder", "revolute", "base", "upper", ""),
    JOINT.format("elbow", "revolute", "upper", "lower", ""),
    JOINT.format("wrist", "fixed", "lower", "palm", ""),
    JOINT.format("l", "revolute", "palm", "left", ""),
    JOINT.format("r", "revolute", "palm", "right", '<mimic joint="l" multiplier="-1"/>'),
)
GROUPS = (
    '<group name="hand"><joint name="l"/><joint name="r"/><joint name="wrist"/></group>',
    '<group name="arm"><chain base_link="base" tip_link="palm"/></group>',
    '<group name="everything"><group name="arm"/><group name="hand"/></group>',
    '<end_effector name="e" parent_link="palm" group="hand"/>',
)


def read(folder: Path, *lines: str) -> Robot:
    srdf_file(folder, *lines)
    return read_urdf(urdf_file(folder, *GRIPPER))


def names(robot: Robot, pair: frozenset[int]) -> set[str]:
    return {robot.links[index] for index in pair}


def reason(robot: Robot, first: str, second: str) -> str | None:
    return robot.untested.get(frozenset((robot.links.index(first), robot.links.index(second))))


def pairs_of(robot: Robot) -> set[frozenset[str]]:
    return {frozenset((robot.shapes[a].name, robot.shapes[b].name)) for a, b in robot.solid_pairs.tolist()}


def test_groups_that_hold_no_other_become_parts_and_order_the_motors(tmp_path: Path) -> None:
    robot = read(tmp_path, *GROUPS)
    assert {part.name: part.motors for part in robot.parts.values()} == {"hand": ("l",), "arm": ("shoulder", "elbow")}
    assert robot.motors == ("l", "shoulder", "elbow")
    assert [robot.parts[part].start for part in robot.parts] == [0, 1]
    assert {shape.name: shape.part for shape in robot.shapes} == {
        "base": "arm", "upper": "arm", "lower": "arm", "palm": "arm", "left": "hand", "right": "hand"
    }  # fmt: skip
    assert robot.where["part", "hand"].endswith("toy.srdf:2")


def test_groups_that_leave_a_motor_out_are_one_part_with_a_warning(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match=r"toy.srdf:2: <group>: the groups do not give every motor one part \(l\)"):
        robot = read(tmp_path, GROUPS[1])
    assert list(robot.parts) == ["all"]


def test_groups_may_name_links_and_hold_themselves(tmp_path: Path) -> None:
    lines = ('<group name="a"><link name="base"/><link name="upper"/><link name="lower"/><group name="a"/></group>', GROUPS[0])
    assert read(tmp_path, *lines).parts["a"].motors == ("shoulder", "elbow")


def test_a_chain_between_two_branches_passes_the_link_that_carries_both(tmp_path: Path) -> None:
    lines = (
        '<group name="hands"><chain base_link="left" tip_link="right"/></group>',
        '<group name="arm"><chain base_link="palm" tip_link="base"/></group>',
    )
    robot = read(tmp_path, *lines)
    assert {part.name: part.motors for part in robot.parts.values()} == {"hands": ("l",), "arm": ("elbow", "shoulder")}


def test_without_an_srdf_only_adjacent_links_are_left_out(tmp_path: Path) -> None:
    robot = read_urdf(urdf_file(tmp_path, *GRIPPER))
    assert {frozenset(names(robot, pair)) for pair in robot.untested} == {
        frozenset(pair) for pair in (("base", "upper"), ("upper", "lower"), ("lower", "left"), ("lower", "right"))
    }
    assert reason(robot, "upper", "lower") == "adjacent: joint elbow"
    tested = [("base", "lower"), ("base", "palm"), ("base", "left"), ("base", "right"), ("upper", "left"), ("upper", "right")]
    assert pairs_of(robot) == {frozenset(pair) for pair in (*tested, ("left", "right"))}


def test_disabled_pairs_are_left_out_with_their_reason(tmp_path: Path) -> None:
    robot = read(tmp_path, '<disable_collisions link1="left" link2="right" reason="Never"/>')
    assert reason(robot, "left", "right") == "disabled in the SRDF: Never (toy.srdf, line 2)"
    assert frozenset(("left", "right")) not in pairs_of(robot)
    assert frozenset(("base", "lower")) in pairs_of(robot)


def test_a_merged_link_is_untested_only_where_all_of_it_is(tmp_path: Path) -> None:
    one = '<disable_collisions link1="base" link2="lower" reason="Never"/>'
    robot = read(tmp_path, one)
    assert reason(robot, "base", "lower") is None
    assert pairs_of(robot) & {frozenset(("base", "lower")), frozenset(("base", "palm"))} == {frozenset(("base", "palm"))}
    both = read(tmp_path, one, '<disable_collisions link1="palm" link2="base"/>')
    assert reason(both, "base", "lower") == "disabled in the SRDF: Never (toy.srdf, line 2)"


def test_a_link_can_be_disabled_as_a_whole_and_pairs_enabled_again(tmp_path: Path) -> None:
    lines = ('<disable_default_collisions link="base"/>', '<enable_collisions link1="base" link2="left"/>')
    enabled_joint = '<enable_collisions link1="upper" link2="lower"/>'
    robot = read(tmp_path, *lines, enabled_joint)
    of_base = {pair for pair in pairs_of(robot) if "base" in pair}
    assert of_base == {frozenset(("base", "left"))}
    assert frozenset(("upper", "lower")) in pairs_of(robot)
    assert reason(robot, "upper", "lower") is None


def test_fields_meet_the_fields_of_other_parts_only(tmp_path: Path) -> None:
    srdf_file(tmp_path, *GROUPS)
    robot = read_urdf(urdf_file(tmp_path, *GRIPPER), UrdfOptions(field=0.02))
    pairs = {frozenset((robot.shapes[a].name, robot.shapes[b].name)) for a, b in robot.field_pairs.tolist()}
    wanted = [(arm, finger) for arm in ("base", "upper") for finger in ("left", "right")]
    assert pairs == {frozenset(f"{name}_field" for name in pair) for pair in wanted}


def test_links_without_solids_at_one_place_count_as_one_joint(tmp_path: Path) -> None:
    wrist = (BODY.format("a"), '<link name="x"/><link name="y"/>', BODY.format("b"))
    turn = '<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{2}"/>{3}</joint>'
    joints = [turn.format("j1", "a", "x", ""), turn.format("j2", "x", "y", ""), turn.format("j3", "y", "b", '<origin xyz="{0} 0 0"/>')]
    robot = read_urdf(urdf_file(tmp_path, *wrist, *joints[:2], joints[2].format("0.01")))
    assert reason(robot, "a", "b") == "adjacent: joints j1 to j3 at one place"
    apart = read_urdf(urdf_file(tmp_path, *wrist, *joints[:2], joints[2].format("0.5")))
    assert reason(apart, "a", "b") is None
    assert pairs_of(apart) == {frozenset(("a", "b"))}


@pytest.mark.parametrize(("span", "tested"), [(0.6, True), (0.01, False)])
def test_a_slide_that_leads_away_from_its_place_does_not_count_as_one_joint(tmp_path: Path, span: float, tested: bool) -> None:
    gantry = (BODY.format("a"), '<link name="x"/><link name="y"/>', BODY.format("b"))
    joint = '<joint name="{0}" type="prismatic"><parent link="{1}"/><child link="{2}"/><limit lower="0" upper="{3}"/></joint>'
    slides = [joint.format("j1", "a", "x", 0.01), joint.format("j2", "x", "y", span), joint.format("j3", "y", "b", 0.01)]
    robot = read_urdf(urdf_file(tmp_path, *gantry, *slides))
    assert pairs_of(robot) == ({frozenset(("a", "b"))} if tested else set())
    assert_same_pairs(robot, load_robot(write_urdf(robot, tmp_path / "written.urdf")))


def test_an_srdf_elsewhere_is_named_by_an_option(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    path = srdf_file(tmp_path / "other", *GROUPS)
    assert list(read_urdf(urdf_file(tmp_path, *GRIPPER), UrdfOptions(srdf=path)).parts) == ["hand", "arm"]


def test_names_that_the_robot_does_not_have_are_warned_of(tmp_path: Path) -> None:
    with pytest.warns(
        UserWarning, match=r"toy.srdf:2: <disable_collisions>: the robot has no 'lefft', so this is ignored. Did you mean 'left'"
    ):
        read(tmp_path, '<disable_collisions link1="lefft" link2="right"/>')


@pytest.mark.parametrize("chain", ['base_link="bse" tip_link="palm"', 'base_link="base" tip_link="plam"'])
def test_a_chain_that_the_robot_does_not_have_is_passed_over(tmp_path: Path, chain: str) -> None:
    with pytest.warns(UserWarning, match="toy.srdf:2: <chain>: the robot has no '(bse|plam)', so this is ignored. Did you mean"):
        robot = read(tmp_path, f'<group name="arm"><chain {chain}/><joint name="elbow"/><joint name="shoulder"/></group>', GROUPS[0])
    assert robot.parts["arm"].motors == ("elbow", "shoulder")


def test_passive_joints_that_get_a_motor_are_named(tmp_path: Path) -> None:
    virtual = '<virtual_joint name="world" type="planar" parent_frame="map" child_link="base"/>'
    with pytest.warns() as caught:
        robot = read(tmp_path, virtual, *(f'<passive_joint name="{name}"/>' for name in ("world", "r", "wrist", "elbow")))
    assert robot.motors == ("shoulder", "elbow", "l")
    assert [one.category for one in caught] == [Simplified]
    assert "toy.srdf:6: <passive_joint>: joint 'elbow' gets a motor, as this library has no passive joints" in str(caught[0].message)


def test_more_groups_than_a_robot_can_have_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match="toy.srdf:1: <robot> group: has 201 groups"):
        read(tmp_path, *(f'<group name="g{k}"><joint name="elbow"/></group>' for k in range(201)))


MALFORMED = {
    "no srdf": (('</robot><robot name="x">',), "not well-formed XML"),
    "no value": (
        ('<group_state name="home" group="arm"><joint name="elbow"/></group_state>',),
        ":2: <joint> value: is required and missing",
    ),
    "no link": (('<disable_collisions link1="left"/>',), ":2: <disable_collisions> link2: is required and missing"),
    "not a number": (
        ('<group_state name="home" group="arm"><joint name="elbow" value="1 0"/></group_state>',),
        ":2: <joint> value: '1 0' is not a number",
    ),
}


@pytest.mark.parametrize("name", MALFORMED)
def test_a_malformed_srdf_is_refused(tmp_path: Path, name: str) -> None:
    lines, message = MALFORMED[name]
    with pytest.raises(RobotFileError, match=message):
        read(tmp_path, *lines)
