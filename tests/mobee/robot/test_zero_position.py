# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from mobee.errors import RobotFileError
from mobee.model.kinematics import link_transforms
from mobee.robot.robot import Robot
from mobee.robot.xml.read import read_robot
from tests.mobee.robot.robot_files import robot_file

ARM = (
    '<bodypart name="arm">',
    ' <motor name="pan" minPos="-90" maxPos="90"><joint z="1">',
    '  <link x="-0.2"><marker name="tip" nx="-1"/></link>',
    " </joint></motor>",
    "</bodypart>",
)


def read(folder: Path, *lines: str) -> Robot:
    return read_robot(robot_file(folder, *lines))


def test_a_link_is_a_step_from_where_its_parent_ended(tmp_path: Path) -> None:
    robot = read(
        tmp_path,
        '<bodypart name="arm">',
        '<link z="0.1"><link x="3" y="4" length="0.5"><motor minPos="-1" maxPos="1"><joint z="2"/></motor></link></link>',
        "</bodypart>",
    )
    np.testing.assert_allclose(robot.joints[0].point, [0.3, 0.4, 0.1], atol=1e-15)
    np.testing.assert_allclose(robot.joints[0].axis, [0, 0, 1])


def test_an_element_inside_a_joint_turns_about_its_axis_through_the_current_point(tmp_path: Path) -> None:
    robot = read(
        tmp_path,
        '<bodypart name="arm"><link y="1"><motor name="m" minPos="-90" maxPos="90"><joint z="1">',
        '<link x="1"><link><marker name="tip"/></link></link></joint></motor></link></bodypart>',
    )
    moved = link_transforms(robot, np.array([np.pi / 2]))[robot.markers["tip"].link]
    np.testing.assert_allclose((moved @ [*robot.markers["tip"].position, 1])[:3], [0, 2, 0], atol=1e-12)


def test_attachments_are_relative_to_the_start_of_the_link_and_to_the_point_of_the_joint(tmp_path: Path) -> None:
    robot = read(
        tmp_path,
        '<bodypart name="arm"><link z="1"><sphere name="a" radius="0.1" px="0.5"/>',
        '<motor minPos="-1" maxPos="1"><joint z="1"><sphere name="b" radius="0.1" py="0.5" field="true"/></joint></motor>',
        "</link></bodypart>",
    )
    on_link, on_joint = robot.shapes
    np.testing.assert_allclose(on_link.position, [0.5, 0, 0])
    np.testing.assert_allclose(on_joint.position, [0, 0.5, 1])
    assert (on_link.role, on_joint.role) == ("solid", "field")
    assert robot.base_shapes == {0}


def test_radius_and_field_give_the_skeleton_a_volume(tmp_path: Path) -> None:
    robot = read(
        tmp_path,
        '<bodypart name="arm"><motor minPos="-1" maxPos="1"><joint y="1" radius="0.03" length="0.1">',
        '<link x="-0.4" radius="0.02" field="0.06"/></joint></motor></bodypart>',
    )
    joint, link, field = robot.shapes
    assert (joint.kind, joint.size, joint.role) == ("cylinder", (0.03, 0.1), "solid")
    assert (link.size, link.role, field.size, field.role) == ((0.02, 0.4), "solid", (0.06, 0.4), "field")
    np.testing.assert_allclose(link.position, [-0.2, 0, 0])
    np.testing.assert_allclose(link.rotation[:, 2], [-1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(joint.rotation[:, 2], [0, 1, 0], atol=1e-12)


def test_a_motors_interval_is_mapped_onto_each_of_its_joints(tmp_path: Path) -> None:
    robot = read(
        tmp_path,
        '<bodypart name="hand"><motor name="close" minPos="0" maxPos="60">',
        '<joint name="a" z="1" minPos="-20" maxPos="0"><joint name="b" z="1" minPos="30" maxPos="0"/></joint>',
        '</motor><motor name="other" minPos="-1" maxPos="1"><joint name="d" z="1"/></motor>',
        '<joint name="c" motor="close" z="1"/></bodypart>',
    )
    matrix, offset = robot.coupling
    for motor, joints in ((0, (-20, 30, 0)), (60, (0, 0, 60))):
        angles = dict(zip((joint.name for joint in robot.joints), np.rad2deg(matrix @ np.deg2rad([motor, 0]) + offset), strict=True))
        assert [angles["a"], angles["b"], angles["c"]] == pytest.approx(joints)
    np.testing.assert_allclose(np.rad2deg(robot.joints[1].limits), [0, 30])


def test_a_prismatic_joint_has_its_interval_in_metres(tmp_path: Path) -> None:
    robot = read(
        tmp_path,
        '<bodypart name="lift"><motor minPos="0" maxPos="180"><joint type="prismatic" z="1" minPos="0" maxPos="0.3"/></motor></bodypart>',
    )
    assert robot.joints[0].kind == "prismatic"
    np.testing.assert_allclose(robot.joints[0].limits, [0, 0.3])
    assert robot.motor_table[0].joints[0][1] == pytest.approx(0.3 / np.pi)


def test_parts_nest_and_motors_follow_their_idx(tmp_path: Path) -> None:
    robot = read(
        tmp_path,
        '<bodypart name="torso"><motor name="pitch" idx="1" minPos="-1" maxPos="1"><joint y="1">',
        '<motor name="yaw" idx="0" minPos="-1" maxPos="1"><joint z="1"><bodypart name="arm"><motor name="elbow" minPos="-1" maxPos="1">',
        '<joint y="1"><sphere radius="0.1"/></joint></motor></bodypart></joint></motor></joint></motor></bodypart>',
    )
    assert robot.motors == ("yaw", "pitch", "elbow")
    assert (robot.parts["torso"].slice, robot.parts["arm"].slice) == (slice(0, 2), slice(2, 3))
    assert robot.shapes[0].part == "arm"
    assert [joint.parent for joint in robot.joints] == [0, 1, 2]


def test_an_idx_left_out_counts_the_motors_of_the_part(tmp_path: Path) -> None:
    one, named = (
        '<motor minPos="-1" maxPos="1"><joint z="1"/></motor>',
        '<motor name="elbow" idx="1" minPos="-1" maxPos="1"><joint z="1"/></motor>',
    )
    robot = read(tmp_path, f'<bodypart name="torso">{one}{one}</bodypart>', f'<bodypart name="arm">{one}{named}{one}</bodypart>')
    assert robot.motors == ("torso_0", "torso_1", "arm_2", "elbow", "arm_4")


def test_home_left_out_is_zero_or_the_limit_nearest_to_it(tmp_path: Path) -> None:
    robot = read(
        tmp_path,
        '<bodypart name="arm"><motor name="a" minPos="15" maxPos="90"><joint z="1"/></motor>',
        '<motor name="b" minPos="-90" maxPos="90" velocity="30" acceleration="100" torque="7"><joint z="1"/></motor></bodypart>',
    )
    np.testing.assert_allclose(np.rad2deg(robot.home), [15, 0])
    motor = robot.motor_table[1]
    assert (motor.max_velocity, motor.max_acceleration, motor.max_torque) == pytest.approx((np.deg2rad(30), np.deg2rad(100), 7))


def test_a_constraint_list_is_a_clause_in_radians_over_the_whole_motor_vector(tmp_path: Path) -> None:
    robot = read(
        tmp_path,
        '<bodypart name="head"><motor name="neck" minPos="-1" maxPos="1"><joint z="1"/></motor></bodypart>',
        '<bodypart name="arm"><motor name="a" minPos="-90" maxPos="90"><joint z="1"/></motor>',
        '<motor name="b" minPos="-90" maxPos="90"><joint z="1"/></motor>',
        '<constraintList><constraint a="2, -1" q="0, 1" b="90"/><constraint a="1" q="b" b="45" negate="true"/></constraintList></bodypart>',
    )
    (clause,) = robot.clauses
    np.testing.assert_allclose(clause.a, [[0, 2, -1], [0, 0, -1]])
    np.testing.assert_allclose(clause.b, [np.pi / 2, -np.pi / 4])
    assert clause.part == "arm"


def test_a_constraint_counts_motors_in_metres_in_metres(tmp_path: Path) -> None:
    robot = read(
        tmp_path,
        '<bodypart name="lift"><motor name="pan" minPos="-90" maxPos="90"><joint z="1"/></motor>',
        '<motor name="slide" unit="m" minPos="0" maxPos="0.2"><joint type="prismatic" z="1"/></motor>',
        '<constraintList><constraint a="-1" q="slide" b="0.15"/></constraintList>',  # slide < 0.15 m
        '<constraintList><constraint a="-1 -100" q="pan slide" b="20"/></constraintList></bodypart>',  # pan [deg] + 100 slide [m] < 20
    )
    pan, slide = np.deg2rad(12.0), 0.1
    inside, outside = np.array([pan, slide - 0.021]), np.array([pan, slide - 0.019])
    single, mixed = robot.clauses
    assert (single.a @ [0.0, 0.149] + single.b, single.a @ [0.0, 0.151] + single.b) == pytest.approx((0.001, -0.001))
    assert (mixed.a @ inside + mixed.b, mixed.a @ outside + mixed.b) == pytest.approx((np.deg2rad(0.1), np.deg2rad(-0.1)))


def test_a_marker_has_a_right_handed_orientation_whose_z_is_its_normal(tmp_path: Path) -> None:
    marker = read(tmp_path, *ARM).markers["tip"]
    np.testing.assert_allclose(marker.normal, [-1, 0, 0])
    np.testing.assert_allclose(marker.rotation[:, 2], marker.normal, atol=1e-12)
    assert np.linalg.det(marker.rotation) == pytest.approx(1)


def test_tags_are_read_in_any_case(tmp_path: Path) -> None:
    assert read(tmp_path, *(line.replace("joint", "JOINT").replace("bodypart", "BodyPart") for line in ARM)).motors == ("pan",)


def test_unknown_tags_and_attributes_are_ignored_with_a_warning_that_names_the_line(tmp_path: Path) -> None:
    path = robot_file(tmp_path, ARM[0], '<shpere radius="1"/>', *ARM[1:])
    with pytest.warns(UserWarning, match=r"toy.xml:3: <shpere>: unknown tag .* Did you mean 'sphere'\?"):
        assert read_robot(path).shapes == ()
    path = robot_file(tmp_path, ARM[0], '<sphere radius="1" colour="red"/>', *ARM[1:])
    with pytest.warns(UserWarning, match=r"toy.xml:3: <sphere>: unknown attribute 'colour' is ignored"):
        assert len(read_robot(path).shapes) == 1


def test_a_second_name_of_the_base_is_reported(tmp_path: Path) -> None:
    links = ('<link name="pelvis" z="1"/>', '<link name="pelvis" x="1"/>', '<link name="foot" z="-1"/>')
    with pytest.warns(UserWarning, match=r"toy.xml:6: <link>: a second name of the base, 'foot', replaces 'pelvis' \(line 4\)"):
        robot = read(tmp_path, '<bodypart name="arm">', MOTOR, *links, "</bodypart>")
    assert robot.links == ("foot", "pan")


def test_unknown_tags_are_ignored_wherever_they_stand(tmp_path: Path) -> None:
    for line in (
        "<constraintList><note/><constraint a='1' q='0' b='180'/></constraintList>",
        '<marker name="m"><note/></marker>',
        "<note><joint/></note>",
    ):
        path = robot_file(tmp_path, ARM[0], *ARM[1:4], line, ARM[4])
        with pytest.warns(UserWarning, match="toy.xml:6: <note>: unknown tag is ignored with all inside"):
            assert read_robot(path).motors == ("pan",)


MOTOR = '<motor name="pan" minPos="-90" maxPos="90"><joint z="1"/></motor>'
BAD = {
    "no number": ('<sphere radius="big"/>', "<sphere> radius: 'big' is not a number"),
    "not a number": ('<sphere radius="nan"/>', "<sphere> radius: 'nan' is not finite"),
    "infinite": ('<link x="inf"/>', "<link> x: 'inf' is not finite"),
    "negative size": ('<box width="0.1" height="-1" depth="0.1"/>', "<box> height: -1 is not positive"),
    "missing": ('<sphere px="1"/>', "<sphere> radius: is required and missing"),
    "misspelt": ('<motor name="tilt" minpos="0" maxPos="1"/>', "<motor> minPos: is required and missing. Did you misspell it as 'minpos'?"),
    "no axis": ('<motor name="tilt" minPos="0" maxPos="1"><joint/></motor>', "<joint> x y z: the direction has no length"),
    "no motor": ('<joint z="1"/>', "<joint> motor: is required and missing"),
    "unknown motor": ('<joint name="j" motor="pam" z="1"/>', "<joint> motor: unknown motor 'pam'. Did you mean 'pan'?"),
    "unknown type": ('<joint name="j" motor="pan" z="1" type="revolut"/>', "unknown type of joint 'revolut'. Did you mean 'revolute'?"),
    "limits swapped": ('<motor name="tilt" minPos="2" maxPos="1"/>', "<motor> minPos: 2 is not below maxPos 1. Swap the two"),
    "home outside": ('<motor name="tilt" minPos="0" maxPos="1" home="5"/>', "<motor> home: 5 is outside of 0 .. 1"),
    "idle motor": ('<motor name="tilt" minPos="0" maxPos="1"/>', "<motor> name: motor 'tilt' drives no joint"),
    "slide in degrees": (
        '<motor name="t" minPos="0" maxPos="90"><joint z="1" type="prismatic"/></motor>',
        "<joint> minPos: joint 't' moves in metres, and its motor 't' in degrees. "
        'Write minPos and maxPos of the joint in metres, or unit="m" in the motor',
    ),
    "hinge in metres": (
        '<motor name="t" unit="m" minPos="0" maxPos="1"><joint z="1" minPos="5"/></motor>',
        "<joint> minPos: joint 't' moves in degrees, and its motor 't' in metres",
    ),
    "stiff joint": ('<joint name="j" motor="pan" z="1" minPos="3" maxPos="3"/>', "<joint> minPos: equals maxPos 3"),
    "second motor": (MOTOR, "<motor> name: a second motor 'pan'. The first is in line 3"),
    "second joint": ('<joint name="pan" motor="pan" z="1"/>', "<joint> name: a second joint 'pan'"),
    "name of the base": (
        '<motor name="base" minPos="0" maxPos="1"><joint z="1"/></motor>',
        "<joint> moves: link 'base' has the name of the base. Name another link with moves=",
    ),
    "second shape": ('<sphere name="s" radius="1"/><sphere name="s" radius="1"/>', "<sphere> name: a second shape 's'"),
    "second marker": ('<marker name="m"/><marker name="m"/>', "<marker> name: a second marker 'm'"),
    "no flag": ('<sphere radius="1" field="maybe"/>', "<sphere> field: 'maybe' is neither true nor false"),
    "flat link": ('<link radius="0.1"/>', "<link> radius: a link without length has no volume"),
    "rotation": ('<marker name="m" rotation="1 0 0 0 1 0 0 0 -1"/>', "<marker> rotation: is not a rotation matrix"),
    "short rotation": ('<marker name="m" rotation="1 0 0"/>', "<marker> rotation: has 3 numbers. Write 9 numbers"),
    "row length": ('<constraintList><constraint a="1 2" q="0" b="1"/></constraintList>', "<constraint> q: names 1 motors for 2 factors"),
    "row motor": (
        '<constraintList><constraint a="1" q="7" b="1"/></constraintList>',
        "part 'arm' has no motor 7. Its motors are 0 to 0: pan",
    ),
    "row name": ('<constraintList><constraint a="1" q="pann" b="1"/></constraintList>', "unknown motor 'pann'. Did you mean 'pan'?"),
    "row zero": ('<constraintList><constraint a="0" q="0" b="1"/></constraintList>', "<constraint> a: is zero"),
    "empty list": ("<constraintList/>", "<constraintlist> constraint: the list is empty"),
    "lone row": ('<constraint a="1" q="0" b="1"/>', "<constraint> position in the file: this tag cannot stand here"),
    "ignored link": ('<ignore first="pan" second="bass"/>', "<ignore> second: unknown link 'bass'. Did you mean 'base'?"),
    "taken name": (
        '<motor name="arm_2" minPos="0" maxPos="1"><joint z="1"/></motor><motor minPos="0" maxPos="1"/>',
        "a second motor 'arm_2'",
    ),
    "double idx": ('<motor name="t" idx="0" minPos="0" maxPos="1"><joint z="1"/></motor>', "<motor> idx: 0 is taken by 'pan'"),
}


@pytest.mark.parametrize("case", BAD)
def test_errors_name_file_line_field_and_remedy(tmp_path: Path, case: str) -> None:
    line, message = BAD[case]
    path = robot_file(tmp_path, '<bodypart name="arm">', MOTOR, line, "</bodypart>")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with pytest.raises(RobotFileError) as caught:
            read_robot(path)
    assert str(caught.value).startswith(f"{path}:4: ")
    assert message in str(caught.value)


def test_a_part_without_motors_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r"toy.xml:3: <bodypart> motor: part 'leg' has no motor"):
        read(tmp_path, f'<bodypart name="arm">{MOTOR}</bodypart>', '<bodypart name="leg"/>')


def test_a_robot_without_parts_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r"toy.xml:1: .* the robot has no body part"):
        read(tmp_path)


def test_a_motor_outside_of_every_part_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotFileError, match=r"toy.xml:2: <motor> position in the file: a motor outside of every part"):
        read(tmp_path, MOTOR)


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.xml"
    path.write_text("<World/>", encoding="utf-8")
    with pytest.raises(RobotFileError, match="other.xml:1: <world> root element: this is not a robot"):
        read_robot(path)
    path.write_text("<robot/>", encoding="utf-8")
    with pytest.raises(RobotFileError, match="this is not a robot.*; a URDF needs a name that ends in .urdf"):
        read_robot(path)
