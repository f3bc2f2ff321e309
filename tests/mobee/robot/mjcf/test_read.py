# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import importlib.util
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mobee.errors import InvalidValue, RobotFileError, Simplified, UnknownName
from mobee.model.model import Model
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.xml.write import write_xml
from tests.mobee.robot.mjcf_files import TREE, mjcf_file
from tests.mobee.robot.same_robot import assert_same_robot

mujoco = pytest.importorskip("mujoco")

COUPLED = """
<equality><joint joint1="f1" joint2="f2" polycoef="0.001 1.2 0 0 0"/></equality>
<actuator><position joint="f2" forcerange="-30 20" gear="2"/><motor joint="knee" ctrlrange="-1 1" gear="50"/></actuator>
"""


def read(path: Path, **options: Any) -> Robot:
    """The robot, without the warnings of the reader."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Simplified)
        return load_robot(path, **options)


def worst_pose_error(path: Path, robot: Robot, seed: int, poses: int = 100) -> float:
    """The largest difference of any marker or mass centre from MuJoCo's own kinematics, over random poses; joints are matched by name."""
    mujoco.set_mju_user_warning(lambda text: None)  # else it writes a log into the working directory
    model = mujoco.MjModel.from_xml_path(str(path))
    mujoco.set_mju_user_warning(None)
    data = mujoco.MjData(model)
    matrix, offset = robot.coupling
    bodies = {model.body(k).name: ("body", k) for k in range(model.nbody)}
    places = bodies | {model.site(k).name: ("site", k) for k in range(model.nsite)}
    mine, worst = Model(robot), 0.0
    for q in np.random.default_rng(seed).uniform(*robot.limits.T, (poses, len(robot.motors))):
        data.qpos[:] = model.qpos0
        for joint, value in zip(robot.joints, matrix @ q + offset, strict=True):
            data.qpos[model.joint(joint.name).qposadr[0]] = value
        mujoco.mj_kinematics(model, data)
        pose = mine.evaluate(q)
        for name in robot.markers:
            kind, index = places[name]
            position, rotation = (data.site_xpos, data.site_xmat) if kind == "site" else (data.xpos, data.xmat)
            worst = max(worst, float(np.abs(pose.position(name) - position[index]).max()))
            worst = max(worst, float(np.abs(pose.rotation(name).ravel() - rotation[index]).max()))
        transforms = np.asarray(pose.transforms)
        for body in robot.bodies:  # every link that weighs something, by the name of its body
            if robot.links[body.link] in bodies and body.link:
                there = transforms[body.link, :3, :3] @ body.centre + transforms[body.link, :3, 3]
                own = bodies[robot.links[body.link]][1]
                if model.body_subtreemass[own] == model.body_mass[own]:
                    worst = max(worst, float(np.abs(there - data.xipos[own]).max()))
    return worst


def test_links_move_as_in_mujoco(tmp_path: Path) -> None:
    path = mjcf_file(tmp_path, TREE + COUPLED)
    robot = read(path)
    assert robot.motors == ("roll", "yaw", "out", "elbow", "f2", "hip", "knee")
    assert set(robot.markers) == {"camera", "torso", "bracket", "finger_1", "finger_2", "shin"}
    assert worst_pose_error(path, robot, seed=1) < 1e-9


@pytest.mark.parametrize(
    ("given", "limits"), [("-inf inf", [-np.pi, np.pi]), ("-1 1e10", [-1.0, 2 * np.pi - 1.0]), ("-inf 1", [1 - 2 * np.pi, 1.0])]
)
def test_infinite_limits_and_forces_mean_unknown(tmp_path: Path, given: str, limits: list[float]) -> None:
    text = f'<compiler angle="radian"/><worldbody><body><joint name="a" range="{given}"/><geom size=".1"/></body></worldbody>'
    robot = read(mjcf_file(tmp_path, f'{text}<actuator><motor joint="a" forcerange="-inf inf"/></actuator>'))
    assert robot.limits[0] == pytest.approx(limits)
    assert robot.motor_table[0].max_torque == 40.0
    assert_same_robot(load_robot(write_xml(robot, tmp_path / "written.xml")), robot)


def test_an_equality_gives_two_joints_one_motor(tmp_path: Path) -> None:
    robot = read(mjcf_file(tmp_path, TREE + COUPLED))
    finger = robot.motor_table[robot.motor_index("f2")]
    assert {robot.joints[j].name: (scale, shift) for j, scale, shift in finger.joints} == {"f2": (1.0, 0.0), "f1": (1.2, 0.001)}
    assert finger.limits == pytest.approx([0.0, 0.03])
    assert finger.max_torque == pytest.approx(60.0)
    assert robot.motor_table[robot.motor_index("knee")].max_torque == pytest.approx(50.0)


@pytest.mark.parametrize("other", ["", 'joint2="roll"'])
def test_a_joint_that_an_equality_holds_stays_at_its_position(tmp_path: Path, other: str) -> None:
    held = f'<equality><joint joint1="elbow" {other} polycoef="0.7 0 0 0 0"/></equality>'
    path = mjcf_file(tmp_path, TREE + held)
    with pytest.warns(Simplified) as caught:
        robot = load_robot(path)
    assert any("elbow is held by an equality" in str(one.message) for one in caught)
    free = read(mjcf_file(tmp_path, TREE))
    assert set(free.motors) - set(robot.motors) == {"elbow"}
    turned = free.home.copy()
    turned[free.motor_index("elbow")] = 0.7 + np.deg2rad(-20.0)  # beside its reference position
    expected, found = Model(free).evaluate(turned), Model(robot).evaluate(robot.home)
    for marker in set(robot.markers) & set(free.markers):
        assert found.position(marker) == pytest.approx(expected.position(marker), abs=1e-9)


def test_a_driven_tendon_moves_its_joints_in_proportion(tmp_path: Path) -> None:
    tendon = '<tendon><fixed name="split"><joint joint="f1" coef=".5"/><joint joint="f2" coef=".25"/></fixed></tendon>'
    robot = read(mjcf_file(tmp_path, f'{TREE}{tendon}<actuator><position tendon="split"/></actuator>'))
    motor = robot.motor_table[robot.motor_index("f1")]
    assert {robot.joints[j].name: scale for j, scale, _ in motor.joints} == {"f1": 1.0, "f2": 0.5}
    assert motor.limits == pytest.approx([0.0, 0.04])
    idle = read(mjcf_file(tmp_path, TREE + tendon))
    assert {"f1", "f2"} <= set(idle.motors)


def test_solids_are_the_geoms_that_can_collide(tmp_path: Path) -> None:
    robot = read(mjcf_file(tmp_path, TREE), field=0.03)
    solids = {shape.name: shape for shape in robot.shapes if shape.role == "solid"}
    assert "floor" not in solids and len(solids) == 8  # nor the shin, which is drawn only
    assert solids["post"].size == pytest.approx((0.2, 0.2, 0.6)) and solids["post"].link == 0
    assert solids["upper"].size == pytest.approx((0.02, 0.2))
    assert {shape.name for shape in robot.shapes if shape.role == "field"} >= {"upper_field", "pad_field"}
    chest = solids["chest"].vertices
    assert chest is not None
    rays = np.random.default_rng(0).normal(size=(200, 3))
    surface = rays / np.linalg.norm(rays, axis=1, keepdims=True) * [0.1, 0.15, 0.2]
    from scipy.spatial import ConvexHull

    planes = ConvexHull(chest).equations
    beyond = surface @ planes[:, :3].T + planes[:, 3]
    assert beyond.max() < 1e-12 and beyond.max(axis=1).min() > -0.05  # around the ellipsoid, and near it


def test_a_mesh_becomes_its_hull(tmp_path: Path) -> None:
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]])
    faces = "".join(f"f {' '.join(str(k + 1) for k in face)}\n" for face in ([0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]))
    (tmp_path / "wedge.obj").write_text("".join(f"v {x} {y} {z}\n" for x, y, z in corners) + faces)
    body = '<body pos="0 0 1"><joint/><geom type="mesh" mesh="wedge"/></body>'
    text = f'<asset><mesh file="wedge.obj" scale="2 2 2"/></asset><worldbody>{body}</worldbody>'
    (shape,) = read(mjcf_file(tmp_path, text)).shapes
    assert shape.vertices is not None
    placed = shape.vertices @ shape.rotation.T + shape.position
    assert sorted(placed.round(6).tolist()) == sorted((2 * corners + [0, 0, 1]).tolist())


def test_home_is_the_keyframe_of_that_name(tmp_path: Path) -> None:
    plain = read(mjcf_file(tmp_path, TREE))
    assert plain.home[plain.motor_index("yaw")] == pytest.approx(np.deg2rad(15))  # the pose in which the file draws it
    base = "0 .1 1 1 0 0 0"
    keys = (
        f'<keyframe><key name="up" qpos="{base} .1 .2 .1 .3 0 0 .4 .5"/><key name="home" qpos="{base} .2 .3 .1 .3 0 0 .4 .6"/></keyframe>'
    )
    path = mjcf_file(tmp_path, TREE + keys)
    assert read(path).home == pytest.approx([0.2, 0.3, 0.1, 0.3, 0.0, 0.0, 0.4, 0.6])
    assert read(path, home="up").home == pytest.approx([0.1, 0.2, 0.1, 0.3, 0.0, 0.0, 0.4, 0.5])
    assert read(path, home="zero").home[0] == 0.0
    with pytest.raises(UnknownName, match="unknown home .*toy.xml.* 'down'.*Valid: home, up, zero"):
        read(path, home="down")


def test_excluded_bodies_are_not_tested(tmp_path: Path) -> None:
    def tested(robot: Robot) -> set[frozenset[str]]:
        return {frozenset(robot.shapes[k].name for k in pair) for pair in robot.solid_pairs.tolist()}

    path = mjcf_file(tmp_path, f'{TREE}<contact><exclude body1="forearm" body2="torso"/></contact>')
    with_all, without = tested(read(mjcf_file(tmp_path, TREE, "all.xml"))), tested(read(path))
    assert with_all - without == {frozenset(("lower", "chest"))}
    assert frozenset(("lower", "post")) in without and frozenset(("upper", "chest")) not in with_all


def test_held_joints_are_reported_once(tmp_path: Path) -> None:
    ball = '<worldbody><body><joint type="ball" name="neck" range="0 90"/><geom size=".1"/></body></worldbody>'
    loop = '<equality><connect body1="finger_1" body2="finger_2" anchor="0 0 0"/></equality>'
    with pytest.warns(Simplified) as caught:
        load_robot(mjcf_file(tmp_path, TREE + ball + loop))
    said = [str(one.message) for one in caught]
    assert [line.partition(" ")[2].partition(":")[0] for line in said] == [
        "root moves freely",
        "neck is a ball joint",
        "floor is ground",
        "connect 'equality_0' couples what this library does not",
    ]
    assert all(line.startswith(f"{tmp_path / 'toy.xml'}:1: ") for line in said)


def test_it_is_written_as_zero_position_xml(tmp_path: Path) -> None:
    robot = read(mjcf_file(tmp_path, TREE + COUPLED), field=0.02)
    assert_same_robot(load_robot(write_xml(robot, tmp_path / "written.xml")), robot)


def test_blank_names_count_as_none(tmp_path: Path) -> None:
    inner = '<body name=" "><joint name=" "/><geom size=".1"/><site name=" "/></body>'
    robot = read(mjcf_file(tmp_path, f'<worldbody><body name="b"><joint name="a"/><geom size=".1"/>{inner}</body></worldbody>'))
    assert (robot.links, robot.motors, tuple(robot.markers)) == (("world", "b", "body_2"), ("a", "joint_1"), ("body_2",))
    assert_same_robot(load_robot(write_xml(robot, tmp_path / "written.xml")), robot)


def test_masses_are_those_of_mujoco(tmp_path: Path) -> None:
    path = mjcf_file(tmp_path, TREE)
    robot, model = read(path), mujoco.MjModel.from_xml_path(str(path))
    assert sum(body.mass for body in robot.bodies) == pytest.approx(float(model.body_mass.sum()))
    data = mujoco.MjData(model)
    for joint in robot.joints:
        data.qpos[model.joint(joint.name).qposadr[0]] = 0.0
    mujoco.mj_kinematics(model, data)
    shin = next(body for body in robot.bodies if robot.links[body.link] == "shin")
    axes = data.ximat[model.body("shin").id].reshape(3, 3)
    assert shin.inertia == pytest.approx(axes @ np.diag(model.body_inertia[model.body("shin").id]) @ axes.T)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("<worldbody><body><geom/></body></worldbody>", "MuJoCo refuses this file.*size"),
        ('<worldbody><body><geom size=".1"/></body></worldbody>', "no joint moves"),
        ('<worldbody><body><joint/><geom type="mesh" mesh="no"/></body></worldbody>', "MuJoCo refuses this file"),
        ('<asset><mesh file="no.stl"/></asset><worldbody/>', "MuJoCo refuses this file.*no.stl.*Put the file where the MJCF names it"),
        ('<worldbody><body><joint/><geom size=".1" pos="0 nan 0"/></body></worldbody>', "toy.xml: a number in this file, .* is nan"),
        (
            '<worldbody><body><joint/><geom size=".1"/><site pos="0 inf 0"/></body></worldbody>',
            "toy.xml: an element is farther than 1e.06 m",
        ),
        (
            '<worldbody><body><joint/><geom size=".1"/></body></worldbody><keyframe><key name="home" qpos="nan"/></keyframe>',
            "toy.xml: a number in this file, .* is nan. Write a decimal number",
        ),
        ("<worldbodi/>", "toy.xml:2: MuJoCo refuses this file.*worldbodi"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path, text: str, problem: str) -> None:
    with pytest.raises(RobotFileError, match=problem):
        read(mjcf_file(tmp_path, text))


def test_files_are_read_in_threads_as_they_are_one_after_the_other(tmp_path: Path) -> None:
    (tmp_path / "broken").mkdir()
    good = mjcf_file(tmp_path, '<worldbody><body><joint/><geom size=".1"/></body></worldbody>')
    broken = mjcf_file(tmp_path / "broken", '<worldbody><body><joint/><geom size=".1" pos="0 nan 0"/></body></worldbody>')

    def said(path: Path) -> str:
        try:
            return str(len(load_robot(path).motors))
        except RobotFileError as error:
            return str(error)

    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(said, [good, broken] * 50))
    assert set(found[::2]) == {"1"} and len(set(found[1::2])) == 1 and found[1].startswith(f"{broken}: a number in this file")


def test_an_srdf_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidValue, match="srdf= is for .urdf files only"):
        read(mjcf_file(tmp_path, TREE), srdf="x.srdf")


def wheel_files() -> list[Path]:
    """The robots of the packages robosuite and dm_control; none where they are not installed."""
    found = []
    for package, pattern in (("robosuite", "models/assets/robots/*/robot.xml"), ("dm_control", "suite/*.xml")):
        spec = importlib.util.find_spec(package)
        if spec is not None and spec.submodule_search_locations:
            found += sorted(Path(spec.submodule_search_locations[0]).glob(pattern))
    return [path for path in found if path.stem != "lqr"]  # which has no joints before the program adds them


@pytest.mark.parametrize("path", wheel_files(), ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_robots_of_others_move_as_in_mujoco(path: Path) -> None:
    assert worst_pose_error(path, read(path), seed=2, poses=20) < 1e-9
