# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import warnings
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.arrays import Array
from mobee.errors import InvalidValue, RobotFileError
from mobee.model.kinematics import link_transforms, point_jacobian
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.urdf.read import UrdfOptions, read_urdf
from mobee.robot.urdf.write import write_urdf
from tests.mobee.robot.urdf_files import ARM, foreign, urdf_file

# prismatic and mimic: panda, pr2_gripper, r2d2, xarm with its gripper; continuous: laikago, mini_cheetah, racecar, r2d2
FOREIGN = (
    "kuka_iiwa/model.urdf",
    "franka_panda/panda.urdf",
    "xarm/xarm6_with_gripper.urdf",
    "laikago/laikago.urdf",
    "a1/a1.urdf",
    "r2d2.urdf",
    "mini_cheetah/mini_cheetah.urdf",
    "pr2_gripper.urdf",
    "racecar/racecar.urdf",
)
SHIPPED = ("icub", "icub_2014", "katana")


class Oracle:
    """Pinocchio's own reading of a URDF; its joints are driven by the robot's motors."""

    def __init__(self, robot: Robot, path: Path) -> None:
        self.robot = robot
        self.model = pinocchio.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        joints = [self.model.joints[self.model.getJointId(joint.name)] for joint in robot.joints]
        self.places = [(joint.idx_q, joint.nq) for joint in joints]
        self.columns = [joint.idx_v for joint in joints]
        self.bodies = {frame.name: k for k, frame in enumerate(self.model.frames) if frame.type == pinocchio.FrameType.BODY}
        assert self.model.nv == len(robot.joints)

    def frames(self, angles: Array) -> dict[str, Array]:
        """The frame (4, 4) of every link at joint positions (J,)."""
        q = pinocchio.neutral(self.model)
        for (start, count), angle in zip(self.places, angles, strict=True):
            q[start : start + count] = (angle,) if count == 1 else (np.cos(angle), np.sin(angle))
        pinocchio.framesForwardKinematics(self.model, self.data, q)
        pinocchio.computeJointJacobians(self.model, self.data, q)
        return {name: self.data.oMf[k].homogeneous for name, k in self.bodies.items()}

    def jacobian(self, link: str) -> Array:
        """(6, n) of the origin of a link's frame at the positions given last."""
        frame = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        per_joint = pinocchio.getFrameJacobian(self.model, self.data, self.bodies[link], frame)
        jacobian: Array = per_joint[:, self.columns] @ self.robot.coupling[0]
        return jacobian


@pytest.mark.parametrize("name", [*FOREIGN, *SHIPPED])
def test_links_and_jacobians_are_those_of_pinocchio_at_200_poses(tmp_path: Path, name: str) -> None:
    robot = load_robot(name if name in SHIPPED else foreign(name))
    oracle = Oracle(robot, write_urdf(robot, tmp_path / "x.urdf") if name in SHIPPED else foreign(name))
    matrix, offset = robot.coupling
    rest = oracle.frames(np.zeros(len(robot.joints)))
    for q in np.random.default_rng(8).uniform(*robot.limits.T, size=(200, len(robot.motors))):
        motion = link_transforms(robot, q)
        frames = oracle.frames(matrix @ q + offset)
        for index, link in enumerate(robot.links):
            assert np.abs(motion[index] @ rest[link] - frames[link]).max() < 1e-9
            jacobian = point_jacobian(robot, motion, index, frames[link][:3, 3])
            assert np.abs(jacobian - oracle.jacobian(link)).max() < 1e-9


@pytest.mark.parametrize("name", FOREIGN)
def test_markers_are_the_frames_of_fixed_and_last_links(name: str) -> None:
    robot = read_urdf(foreign(name))
    rest = Oracle(robot, foreign(name)).frames(np.zeros(len(robot.joints)))
    assert set(rest) == {*robot.links, *robot.markers}
    for marker in robot.markers.values():
        assert np.abs(rest[marker.name][:3, 3] - marker.position).max() < 1e-9
        assert np.abs(rest[marker.name][:3, :3] - marker.rotation).max() < 1e-9
        assert np.array_equal(marker.normal, marker.rotation[:, 2])


@cache
def robot_of(name: str) -> Robot:
    return read_urdf(foreign(name))


@given(st.sampled_from(["franka_panda/panda.urdf", "pr2_gripper.urdf", "r2d2.urdf"]), st.integers(0, 2**32 - 1))
def test_jacobians_are_the_slopes_of_the_motion(name: str, seed: int) -> None:
    robot, rng = robot_of(name), np.random.default_rng(seed)
    q = rng.uniform(*robot.limits.T)
    link, point = int(rng.integers(1, len(robot.links))), np.append(rng.normal(size=3), 1.0)
    now = link_transforms(robot, q)[link] @ point
    jacobian = point_jacobian(robot, link_transforms(robot, q), link, now[:3])
    step = 1e-6
    for k in range(len(q)):
        ahead, behind = (link_transforms(robot, q + sign * step * np.eye(len(q))[k])[link] for sign in (1, -1))
        slope = (ahead - behind) / (2 * step)
        assert np.abs((slope @ point)[:3] - jacobian[:3, k]).max() < 1e-8
        turn = slope[:3, :3] @ link_transforms(robot, q)[link][:3, :3].T
        assert np.abs([turn[2, 1], turn[0, 2], turn[1, 0]] - jacobian[3:, k]).max() < 1e-8


def test_a_fixed_link_is_merged_into_its_parent(tmp_path: Path) -> None:
    tip = (
        '<link name="tip"/><joint name="t" type="fixed"><parent link="upper"/><child link="tip"/><origin xyz="0 2 0" rpy="1 0 0"/></joint>'
    )
    robot = read_urdf(urdf_file(tmp_path, *ARM, tip))
    assert robot.links == ("base", "upper", "lower")
    assert robot.markers["tip"].link == 1
    assert np.allclose(robot.markers["tip"].normal, [0, -np.sin(1), np.cos(1)])
    assert robot.markers["lower"].link == 2


def test_everything_knows_the_line_it_was_read_from(tmp_path: Path) -> None:
    tip = '<link name="tip"><collision name="c"><geometry><sphere radius="1"/></geometry></collision></link>'
    path = urdf_file(tmp_path, *ARM, tip, '<joint name="t" type="fixed"><parent link="upper"/><child link="tip"/></joint>')
    lines = {key: int(place.removeprefix(f"{path}:")) for key, place in read_urdf(path).where.items()}
    assert lines == {
        ("robot", "toy"): 1,
        ("part", "all"): 1,
        ("link", "base"): 2,
        ("link", "upper"): 2,
        ("link", "lower"): 2,
        ("joint", "shoulder"): 3,
        ("motor", "shoulder"): 3,
        ("joint", "elbow"): 5,
        ("motor", "elbow"): 5,
        ("shape", "c"): 7,
        ("marker", "tip"): 7,
        ("marker", "lower"): 2,
    }


def test_shapes_of_one_name_are_numbered(tmp_path: Path) -> None:
    ball = "<collision><geometry><sphere radius='1'/></geometry></collision>"
    fixed = '<joint name="t" type="fixed"><parent link="upper"/><child link="tip"/></joint>'
    path = urdf_file(tmp_path, *ARM, f'<link name="tip">{ball}{ball}{ball}</link>', fixed)
    assert [shape.name for shape in read_urdf(path).shapes] == ["tip", "tip_0", "tip_1"]


def test_shapes_on_the_base_are_not_tested_against_the_world() -> None:
    robot = read_urdf(foreign("kuka_iiwa/model.urdf"), UrdfOptions(field=0.03))
    assert {robot.shapes[index].link for index in robot.base_shapes} == {0}
    assert len(robot.base_shapes) == sum(shape.link == 0 for shape in robot.shapes) == 2


@pytest.mark.parametrize("field", [0.0, -1.0, float("nan"), 9.0, True, "0.03", [0.03]])
def test_a_field_without_reach_is_refused(field: Any) -> None:
    with pytest.raises(InvalidValue, match="is no distance for a field. Give metres, such as field=0.03"):
        read_urdf(foreign("r2d2.urdf"), UrdfOptions(field=field))


@pytest.mark.parametrize(("options", "message"), [({"srdf": 5}, "srdf=5 is no path"), ({"home": 5}, "home=5 is no name of a pose")])
def test_options_of_a_wrong_type_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValue, match=message):
        read_urdf(foreign("r2d2.urdf"), UrdfOptions(**options))


@pytest.mark.parametrize("corners", [7, 0, -1, 64.0, True, "64", "exact", None])
def test_an_invalid_number_of_corners_is_refused(corners: Any) -> None:
    with pytest.raises(InvalidValue, match="is no number of corners. Give a whole number from 8 on, or "):
        read_urdf(foreign("r2d2.urdf"), UrdfOptions(corners=corners))


def test_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "toy.urdf"
    path.write_text("<sdf/>")
    with pytest.raises(RobotFileError, match="toy.urdf:1: <sdf> root element: this is not a URDF file"):
        read_urdf(path)
    path.write_text('<!DOCTYPE r [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]>\n<robot name="&b;"/>')
    with pytest.raises(RobotFileError, match="entities and external references are refused"):
        read_urdf(path)


def test_robots_of_other_makers_are_read_without_a_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for name in FOREIGN:
            assert read_urdf(foreign(name)).shapes
