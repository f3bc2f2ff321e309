# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import defusedxml.ElementTree
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mobee.errors import InvalidValue
from mobee.model.kinematics import link_transforms
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.urdf.write import write_urdf
from mobee.robot.xml.write import write_xml
from tests.mobee.robot.robot_files import arm_on_a_pillar, robot_file
from tests.mobee.robot.same_robot import assert_same_robot
from tests.mobee.robot.test_write_xml import random_robot
from tests.mobee.robot.urdf_files import foreign

SHIPPED = ("icub", "icub_2014", "katana")
FOREIGN = ("franka_panda/panda.urdf", "xarm/xarm6_with_gripper.urdf", "r2d2.urdf", "laikago/laikago.urdf", "pr2_gripper.urdf")


def read_back(robot: Robot, folder: Path) -> Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return load_robot(write_urdf(robot, folder / "written.urdf"))


@pytest.mark.parametrize("name", SHIPPED)
def test_xml_becomes_a_urdf_of_the_same_robot(tmp_path: Path, name: str) -> None:
    robot = load_robot(name)
    assert_same_robot(robot, read_back(robot, tmp_path))


@pytest.mark.parametrize("name", FOREIGN)
def test_a_urdf_is_read_back_as_it_was(tmp_path: Path, name: str) -> None:
    robot = load_robot(foreign(name), field=0.03)
    assert_same_robot(robot, read_back(robot, tmp_path))


@pytest.mark.parametrize("name", FOREIGN)
def test_a_urdf_written_as_xml_and_back_is_the_same_urdf(tmp_path: Path, name: str) -> None:
    robot = load_robot(foreign(name))
    assert_same_robot(robot, read_back(load_robot(write_xml(robot, tmp_path / "x.xml")), tmp_path))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**32 - 200))
def test_any_robot_is_read_back_as_it_was(tmp_path: Path, seed: int) -> None:
    robot = random_robot(seed, 1.0)
    written = read_back(robot, tmp_path)
    assert_same_robot(robot, written)


def test_capsules_that_meet_and_cylinders_with_spheres_remain_what_they_are(tmp_path: Path) -> None:
    path = robot_file(
        tmp_path,
        '<bodypart name="arm"><motor name="pan" minPos="-90" maxPos="90"><joint z="1">',
        '<sphere name="knob" radius="0.02"/><capsule name="a" radius="0.02" height="0.2" px="-0.1" hx="1"/>',
        '<capsule name="b" radius="0.02" height="0.2" px="-0.3" hx="1"/><sphere name="s" radius="0.02"/>',
        '<cylinder name="c" radius="0.02" height="0.4" px="-0.2" hx="1"/>',
        '<cylinder name="f" radius="0.02" height="0.4" px="-0.2" field="true"/>',
        '<sphere name="g" radius="0.02" px="-0.2" py="0.2" field="true"/><sphere name="h" radius="0.02" px="-0.2" py="-0.2" field="true"/>',
        "</joint></motor></bodypart>",
    )
    robot = load_robot(path)
    assert_same_robot(robot, read_back(robot, tmp_path))


def test_a_cylinder_between_two_capsules_remains_one(tmp_path: Path) -> None:
    path = robot_file(
        tmp_path,
        '<bodypart name="arm"><motor name="pan" minPos="-90" maxPos="90"><joint z="1">',
        '<capsule name="a" radius="0.05" height="0.2" py="-0.1"/><cylinder name="c" radius="0.05" height="0.2" py="0.1"/>',
        '<capsule name="b" radius="0.05" height="0.2" py="0.3"/></joint></motor></bodypart>',
    )
    robot = load_robot(path)
    assert [shape.kind for shape in robot.shapes] == ["capsule", "cylinder", "capsule"]
    assert_same_robot(robot, read_back(robot, tmp_path))


def test_shapes_outside_of_every_part_remain_there(tmp_path: Path) -> None:
    robot = load_robot(arm_on_a_pillar(tmp_path))
    assert robot.shapes[0].part == ""
    assert len(robot.field_pairs) == 1
    assert_same_robot(robot, read_back(robot, tmp_path))


def test_coupled_motors_are_mimic_joints_and_markers_fixed_links(tmp_path: Path) -> None:
    root = defusedxml.ElementTree.parse(write_urdf(load_robot("katana"), tmp_path / "k.urdf")).getroot()
    mimics = {joint.get("name"): joint.find("mimic").attrib for joint in root.iter("joint") if joint.find("mimic") is not None}
    assert mimics == {"arm_5_6": {"joint": "arm_5", "multiplier": "1", "offset": "0"}}
    icub = defusedxml.ElementTree.parse(write_urdf(load_robot("icub"), tmp_path / "i.urdf")).getroot()
    fixed = {joint.find("child").get("link") for joint in icub.iter("joint") if joint.get("type") == "fixed"}
    assert {"left_palm", "right_palm", "head_marker"} <= fixed  # there is a link head already


def test_clauses_are_written_in_a_comment(tmp_path: Path) -> None:
    text = write_urdf(load_robot("icub"), tmp_path / "i.urdf").read_text()
    comment = text[text.index("<!--") : text.index("-->")]
    assert "clause 0, left_arm: 1.71 l_shoulder_pitch + -1.71 l_shoulder_roll + 6.056" in comment
    assert comment.count("clause ") == len(load_robot("icub").clauses) + 1


def test_other_programs_get_solids_to_see_and_to_touch(tmp_path: Path) -> None:
    robot = load_robot("icub")
    root = defusedxml.ElementTree.parse(write_urdf(robot, tmp_path / "i.urdf")).getroot()
    for tag in ("visual", "collision"):
        names = {element.get("name").split("_cap_")[0] for element in root.iter(tag)}
        assert names == {shape.name for shape in robot.shapes if shape.role == "solid"}
        geometries = {form.tag for element in root.iter(tag) for form in element.find("geometry")}
        assert geometries <= {"sphere", "cylinder", "box", "mesh"}


def test_other_programs_read_the_hulls(tmp_path: Path) -> None:
    robot = load_robot(foreign("xarm/xarm6_with_gripper.urdf"))
    path = write_urdf(robot, tmp_path / "x.urdf")
    hulls = sum(shape.kind == "convex" for shape in robot.shapes)
    assert hulls > 0
    mujoco = pytest.importorskip("mujoco")
    spec = mujoco.MjSpec.from_file(str(path))
    spec.compiler.balanceinertia = True  # the file has moments of inertia that no rigid body has
    assert len(spec.meshes) == hulls and spec.compile().nmesh == hulls
    pybullet = pytest.importorskip("pybullet")
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = pybullet.loadURDF(str(path), useFixedBase=True, physicsClientId=client)
        links = range(-1, pybullet.getNumJoints(body, physicsClientId=client))
        assert sum(len(pybullet.getCollisionShapeData(body, link, physicsClientId=client)) for link in links) == hulls
    finally:
        pybullet.disconnect(client)


def test_bullet_moves_the_written_icub_as_the_model_does(tmp_path: Path) -> None:
    bullet = pytest.importorskip("pybullet")
    robot = load_robot("icub")
    client = bullet.connect(bullet.DIRECT)
    try:
        body = bullet.loadURDF(str(write_urdf(robot, tmp_path / "i.urdf")), useFixedBase=True, physicsClientId=client)
        infos = [bullet.getJointInfo(body, k, physicsClientId=client) for k in range(bullet.getNumJoints(body, physicsClientId=client))]
        places = {info[1].decode(): k for k, info in enumerate(infos)}
        links = {info[12].decode(): k for k, info in enumerate(infos)}
        matrix, offset = robot.coupling
        for q in np.random.default_rng(10).uniform(*robot.limits.T, size=(5, len(robot.motors))):
            for joint, angle in zip(robot.joints, matrix @ q + offset, strict=True):
                bullet.resetJointState(body, places[joint.name], float(angle), physicsClientId=client)
            for side in ("left_palm", "right_palm"):
                state = bullet.getLinkState(body, links[side], computeForwardKinematics=True, physicsClientId=client)
                marker = robot.marker(side)
                moved = link_transforms(robot, q)[marker.link]
                assert np.abs(moved[:3, :3] @ marker.position + moved[:3, 3] - state[4]).max() < 1e-5  # Bullet counts in float
    finally:
        bullet.disconnect(client)


def test_a_joint_of_two_motors_is_refused_with_a_remedy(tmp_path: Path) -> None:
    robot = load_robot("katana")
    first, second, *others = robot.motor_table
    both = replace(robot, motor_table=(first, replace(second, joints=(*second.joints, first.joints[0])), *others))
    with pytest.raises(InvalidValue, match="joint 'arm_0' is driven by 'arm_0' and 'arm_1'. Make two joints of it, on the same axis"):
        write_urdf(both, tmp_path / "x.urdf")
