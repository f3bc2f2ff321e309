# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import importlib.util
import re
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mobee.derivation import derive
from mobee.derivation.arms import names_of
from mobee.errors import InvalidValue, Simplified, UnknownName
from mobee.learning.agent import CuriousAgent, run
from mobee.model.model import Model
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.xml.write import write_xml
from mobee.simulation.plant import OfflinePlant
from tests.mobee.robot.mjcf_files import TREE, mjcf_file
from tests.mobee.robot.same_robot import assert_same_robot


def limb(name: str, x: float, y: float, z: float, up: float = 0.0) -> str:
    """An arm of three joints that hangs from the trunk, as URDF."""
    joints, links, parent = [], [], "trunk"
    for number, (axis, length) in enumerate((("1 0 0", 0.05), ("0 1 0", 0.3), ("0 1 0", 0.3))):
        child, place = f"{name}_link{number}", f"{x} {y} {z}" if number == 0 else f"0 0 {-length if number == 2 else -0.05}"
        links.append(
            f'<link name="{child}"><collision><origin xyz="0 0 {-length / 2}"/>'
            f'<geometry><cylinder radius="0.03" length="{0.8 * length}"/></geometry></collision></link>'
        )
        joints.append(
            f'<joint name="{name}_joint{number}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="{place}" '
            f'rpy="0 {up if number == 0 else 0} 0"/><axis xyz="{axis}"/><limit lower="-1.5" upper="1.5" velocity="1" effort="9"/></joint>'
        )
        parent = child
    return "".join(links + joints)


def urdf(folder: Path, *limbs: str) -> Robot:
    trunk = '<link name="trunk"><collision><geometry><box size="0.5 0.3 0.1"/></geometry></collision></link>'
    path = folder / "limbs.urdf"
    path.write_text(f'<robot name="limbs">{trunk}{"".join(limbs)}</robot>')
    return load_robot(path)


def test_the_legs_of_a_quadruped_are_its_arms(tmp_path: Path) -> None:
    corners = {"fl": (0.25, 0.2), "fr": (0.25, -0.2), "hl": (-0.25, 0.2), "hr": (-0.25, -0.2)}
    derived = derive(urdf(tmp_path, *(limb(f"{name}_hip", x, y, 0.0) for name, (x, y) in corners.items())))
    assert [arm.part for arm in derived.arms] == ["fl_hip_leg", "fr_hip_leg", "hl_hip_leg", "hr_hip_leg"]
    assert all(len(arm.joints) == 3 for arm in derived.arms)
    assert tuple(derived.robot.parts) == tuple(arm.part for arm in derived.arms)
    assert not Model(derived.robot).evaluate(derived.robot.home).contacts


def test_arms_named_as_the_body_or_as_a_hand_keep_their_motors(tmp_path: Path) -> None:
    trunk = limb("column", 0.0, 0.0, 0.0)
    above = [
        limb(name, x, 0.0, -0.3).replace('parent link="trunk"', 'parent link="column_link2"') for name, x in (("body", 0.2), ("tool", -0.2))
    ]
    robot = urdf(tmp_path, trunk, *above)
    derived = derive(robot)
    assert set(derived.robot.parts) == {"body", "tool", "body_2"}
    assert set(derived.robot.motors) == set(robot.motors)
    fingers = [
        f'<link name="{name}"><collision><geometry><sphere radius="0.01"/></geometry></collision></link>'
        f'<joint name="{name}" type="revolute"><parent link="left_arm_link2"/><child link="{name}"/>'
        f'<origin xyz="0 {y} -0.3"/><axis xyz="1 0 0"/>'
        '<limit lower="-0.5" upper="0.5" velocity="1" effort="9"/></joint>'
        for name, y in (("finger", 0.05), ("thumb", -0.05))
    ]
    robot = urdf(tmp_path, limb("left_arm", 0.2, 0.0, 0.0), *fingers, limb("left_arm_hand", -0.2, 0.0, 0.0))
    derived = derive(robot)
    assert set(derived.robot.parts) == {"left_arm", "left_arm_hand_2", "left_arm_hand"}
    assert set(derived.robot.motors) == set(robot.motors)


def test_an_arm_with_a_gripper_keeps_the_fingers_apart(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Simplified)
        derived = derive(load_robot(mjcf_file(tmp_path, TREE)))
    assert {arm.part: arm.motors for arm in derived.arms} == {"arm": ("roll", "yaw", "out", "elbow"), "leg": ("hip", "knee")}
    assert derived.robot.parts["arm_hand"].motors == ("f1", "f2")
    assert {shape.part for shape in derived.robot.shapes if shape.link and "finger" in derived.robot.links[shape.link]} == {"arm_hand"}


@pytest.mark.parametrize("name", ["icub", "katana"])
def test_parts_and_fields_of_a_file_stay(name: str) -> None:
    robot = load_robot(name)
    derived = derive(robot)
    if name == "icub":
        assert_same_robot(derived.robot, robot)
        assert {"left_arm", "right_arm"} <= {arm.part for arm in derived.arms}
        assert derived.field == 0.0 and derived.left_out == ()
    else:
        assert [(arm.part, len(arm.motors)) for arm in derived.arms] == [("arm", 5)]


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (-6.3, 6.3, (-np.pi, np.pi)),
        (-0.1, 6.3, (-0.1, 2.0 * np.pi - 0.1)),
        (-9.0, 0.1, (0.1 - 2.0 * np.pi, 0.1)),
        (0.0, 6.3, (0.0, 2.0 * np.pi)),
    ],
)
def test_a_joint_with_a_range_of_more_than_a_turn_gets_one_turn_of_it(
    tmp_path: Path, low: float, high: float, expected: tuple[float, float]
) -> None:
    path = tmp_path / "limbs.urdf"
    urdf(tmp_path, limb("shoulder", 0.0, 0.3, 0.0))
    path.write_text(path.read_text().replace('lower="-1.5" upper="1.5"', f'lower="{low}" upper="{high}"'))
    derived = derive(load_robot(path))
    assert derived.limited == derived.robot.motors
    assert derived.robot.limits == pytest.approx(np.tile(expected, (3, 1)))


def test_a_motor_is_limited_if_a_joint_that_follows_it_turns_by_more_than_a_turn(tmp_path: Path) -> None:
    path = tmp_path / "limbs.urdf"
    urdf(tmp_path, limb("shoulder", 0.0, 0.3, 0.0))
    first, second, third = path.read_text().rpartition('<limit lower="-1.5" upper="1.5"')
    path.write_text(f'{first}<mimic joint="shoulder_joint0" multiplier="3"/>{second.replace("1.5", "9")}{third}')
    derived = derive(load_robot(path))
    assert derived.limited == ("shoulder_joint0",)
    assert derived.robot.limits[derived.robot.motor_index("shoulder_joint0")] == pytest.approx([-np.pi / 3.0, np.pi / 3.0])


def test_home_is_moved_out_of_contact(tmp_path: Path) -> None:
    robot = urdf(tmp_path, limb("left_shoulder", 0.0, 0.05, 0.2), limb("right_shoulder", 0.0, -0.05, 0.2))
    table = tuple(replace(motor, home=-0.5 if motor.name == "left_shoulder_joint0" else motor.home) for motor in robot.motor_table)
    crossed = replace(robot, motor_table=table)
    assert Model(crossed).evaluate(crossed.home).contacts
    derived = derive(crossed)
    assert derived.home_moved and not derived.left_out
    assert not Model(derived.robot).evaluate(derived.robot.home).contacts


def test_pairs_that_touch_in_most_poses_are_left_out(tmp_path: Path) -> None:
    robot = urdf(tmp_path, limb("left_shoulder", 0.0, 0.1, 0.0))
    derived = derive(robot)
    solids = {frozenset((robot.shapes[a].link, robot.shapes[b].link)) for a, b in derived.robot.solid_pairs.tolist()}
    named = {frozenset((robot.links.index(a), robot.links.index(b))) for a, b in derived.left_out}
    assert named and not named & solids
    assert all(pair in derived.robot.untested for pair in named)


def test_the_same_seed_derives_the_same_robot(tmp_path: Path) -> None:
    robot = urdf(tmp_path, limb("left_shoulder", 0.0, 0.05, 0.2), limb("right_shoulder", 0.0, -0.05, 0.2))
    one, other = derive(robot, seed=3), derive(robot, seed=3)
    assert one.arms == other.arms and (one.robot.home == other.robot.home).all()
    assert np.array_equal(one.robot.field_pairs, other.robot.field_pairs)


def test_a_seed_that_is_no_whole_number_of_at_least_0_is_refused(tmp_path: Path) -> None:
    robot = urdf(tmp_path, limb("left_shoulder", 0.0, 0.3, 0.2))
    wrong: tuple[Any, ...] = (-1, 1.5, True)
    for seed in wrong:
        with pytest.raises(InvalidValue, match="must be a whole number, 0 or more"):
            derive(robot, seed=seed)


@pytest.mark.parametrize("robot", ["katana", None])
def test_what_is_no_robot_is_refused(robot: Any) -> None:
    with pytest.raises(InvalidValue, match=f"robot is {robot!r}; it must be a Robot, as load_robot returns it"):
        derive(robot)


@pytest.mark.parametrize("parts", [["arm_0"], {"arm": "arm_0"}, {"arm": 3}])
def test_parts_that_are_no_dict_of_lists_are_refused(parts: Any) -> None:
    with pytest.raises(InvalidValue, match="it must be a dict from parts to lists of motors"):
        derive(load_robot("katana"), parts)


def test_requested_joints_make_the_part(tmp_path: Path) -> None:
    robot = urdf(tmp_path, limb("left_shoulder", 0.0, 0.3, 0.2), limb("right_shoulder", 0.0, -0.3, 0.2))
    derived = derive(robot, {"mine": ("left_shoulder_joint2", "left_shoulder_joint0")})
    (arm,) = derived.arms
    assert (arm.part, arm.joints) == ("mine", ("left_shoulder_joint2", "left_shoulder_joint0"))
    assert set(derived.robot.parts) == {"mine", "all"}
    with pytest.raises(UnknownName, match="Did you mean 'left_shoulder_joint0'"):
        derive(robot, {"mine": ("left_shoulder_joint00",)})
    with pytest.raises(InvalidValue, match="left_arm.* has not all of r_elbow"):
        derive(load_robot("icub"), {"left_arm": ("r_elbow",)})
    with pytest.raises(InvalidValue, match="named twice in left_arm, mine"):
        derive(load_robot("icub"), {"left_arm": ("l_elbow",), "mine": ("l_elbow",)})


def test_a_derived_robot_is_written_and_learns_without_contact(tmp_path: Path) -> None:
    robot = urdf(tmp_path, limb("left_shoulder", 0.0, 0.35, 0.2), limb("right_shoulder", 0.0, -0.35, 0.2))
    derived = derive(robot)
    assert derived.field > 0.0 and len(derived.robot.field_pairs)
    again = load_robot(write_xml(derived.robot, tmp_path / "robot.xml"))
    assert_same_robot(again, derived.robot)
    plant = OfflinePlant(Model(derived.robot), seed=0, gains=derived.gains)
    probe, deepest = Model(replace(derived.robot, field_pairs=derived.robot.field_pairs[:0])), 0.0

    def note(time: float) -> None:
        nonlocal deepest
        deepest = max([deepest, *(contact.depth for contact in probe.evaluate(plant.motors.q).contacts)])

    plant.every(5, note)
    agents = [CuriousAgent(derived.space(arm), plant, seed=0) for arm in derived.arms]
    run(agents, 60)
    assert deepest < 0.002
    assert [len(agent.model.space.joints) for agent in agents] == [3, 3]


def test_the_motors_that_are_not_learned_stay_at_home() -> None:
    robot = load_robot("katana")
    derived = derive(robot)
    (arm,) = derived.arms
    target, part = derived.space(arm).target(0), derived.robot.parts["arm"]
    others = [k for k, name in enumerate(part.motors) if name not in arm.joints]
    assert target[others] == pytest.approx(derived.robot.home[part.slice][others], abs=1e-5)


def test_a_robot_without_arms_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "wheel.urdf"
    wheel = '<link name="wheel"><collision><geometry><cylinder radius="0.1" length="0.05"/></geometry></collision></link>'
    axle = '<joint name="axle" type="continuous"><parent link="base"/><child link="wheel"/><axis xyz="0 0 1"/></joint>'
    path.write_text(f'<robot name="wheel"><link name="base"/>{wheel}{axle}</robot>')
    with pytest.raises(InvalidValue, match="no chain of joints whose motors move its end"):
        derive(load_robot(path))


def test_a_robot_without_shapes_learns_too(tmp_path: Path) -> None:
    urdf(tmp_path, limb("shoulder", 0.0, 0.3, 0.0))
    path = tmp_path / "limbs.urdf"
    path.write_text(re.sub(r"<collision>.*?</collision>", "", path.read_text()))
    derived = derive(load_robot(path))
    assert not derived.robot.shapes and derived.arms[0].movement > 0.1


@pytest.mark.parametrize(
    ("groups", "names"),
    [
        ([["panda_joint1", "panda_joint2"]], ["arm"]),
        ([["r_shoulder_pitch", "r_elbow"], ["l_shoulder_pitch", "l_elbow"]], ["right_arm", "left_arm"]),
        ([["LeftHipYaw", "LeftKneePitch"], ["RightShoulderRoll", "RightElbow"]], ["left_leg", "right_arm"]),
        ([["FL_HAA", "FL_KFE"], ["HR_HAA", "HR_KFE"]], ["fl_leg", "hr_leg"]),
        ([["joint_0.0", "joint_1.0"], ["joint_4.0", "joint_5.0"]], ["arm", "arm_2"]),
        ([["robot/left.wrist", "robot/left.elbow"], ["Größe"]], ["left_arm", "gr_e"]),
    ],
)
def test_parts_are_named_by_common_words(groups: list[list[str]], names: list[str]) -> None:
    assert names_of(groups) == names


def data_file(name: str) -> Path | None:
    spec = importlib.util.find_spec("pybullet_data")
    path = Path(spec.submodule_search_locations[0]) / name if spec is not None and spec.submodule_search_locations else None
    return path if path is not None and path.is_file() else None


@pytest.mark.skipif(data_file("franka_panda/panda.urdf") is None, reason="pybullet_data is not installed, or was trimmed")
def test_a_panda_is_an_arm_and_a_hand() -> None:
    path = data_file("franka_panda/panda.urdf")
    assert path is not None
    derived = derive(load_robot(path))
    assert {name: len(part) for name, part in derived.robot.parts.items()} == {"arm": 7, "hand": 1}
    assert derived.arms[0].joints == tuple(f"panda_joint{k}" for k in (1, 2, 3, 4))
    assert not Model(derived.robot).evaluate(derived.robot.home).contacts
