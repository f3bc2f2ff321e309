# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mobee.errors import InvalidValue, RobotFileError
from mobee.robot.load import load_robot
from mobee.robot.robot import Body, Joint, Marker, Motor, Part, Robot, Shape
from mobee.robot.xml.write import write_xml
from tests.mobee.robot.robot_files import arm_on_a_pillar, robot_file
from tests.mobee.robot.same_robot import assert_same_robot
from tests.mobee.robot.urdf_files import foreign

SHIPPED = ("icub", "icub_2014", "katana")
FOREIGN = ("franka_panda/panda.urdf", "xarm/xarm6_with_gripper.urdf", "r2d2.urdf", "a1/a1.urdf", "pr2_gripper.urdf", "racecar/racecar.urdf")


def read_back(robot: Robot, folder: Path) -> Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return load_robot(write_xml(robot, folder / "written.xml"))


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_robot_is_read_back_as_it_was(tmp_path: Path, name: str) -> None:
    robot = load_robot(name)
    written = read_back(robot, tmp_path)
    assert_same_robot(robot, written)
    assert written.untested.keys() == robot.untested.keys()
    assert list(written.untested.values()) == list(robot.untested.values())
    clauses = sorted(robot.clauses, key=lambda clause: list(robot.parts).index(clause.part))
    for clause, twin in zip(clauses, written.clauses, strict=True):
        assert clause.part == twin.part
        assert np.abs(clause.a - twin.a).max() < 1e-12
        assert np.abs(clause.b - twin.b).max() < 1e-12


@pytest.mark.parametrize("meshes", ["hull", "bounding"])
@pytest.mark.parametrize("name", FOREIGN)
def test_a_urdf_becomes_xml_of_the_same_robot(tmp_path: Path, name: str, meshes: str) -> None:
    robot = load_robot(foreign(name), field=0.03, meshes=meshes)
    again = read_back(robot, tmp_path)
    assert_same_robot(robot, again)
    assert all(motor.zone_ends_at_home for motor in again.motor_table)


def test_angles_that_are_whole_degrees_are_written_so(tmp_path: Path) -> None:
    text = write_xml(load_robot("icub"), tmp_path / "i.xml").read_text()
    assert '<motor name="torso_roll" minPos="-30" maxPos="30" home="0" velocity="60" acceleration="600" torque="40"/>' in text


def turned(seed: int) -> np.ndarray:
    rotation = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return rotation * np.linalg.det(rotation)


def random_robot(seed: int, tilt: float) -> Robot:
    """Any tree, coupled and prismatic joints, shapes of every kind; `tilt`: how far boxes are from standing on their heads [rad]."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 7))
    parents = []
    for k in range(count):  # depth first: a joint is mounted on the last link or on one that carries it
        chain, link = [k], k
        while link > 0:
            link = parents[link - 1]
            chain.append(link)
        parents.append(int(rng.choice(chain)))
    axes = rng.normal(size=(count, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    owners = [0, *(int(rng.integers(0, 3)) for _ in range(count - 1))]
    owners = [sorted(set(owners)).index(owner) for owner in owners]
    motors = []
    limits: dict[int, np.ndarray] = {}
    for k in range(max(owners) + 1):
        low, high = np.sort(rng.uniform(-3, 3, 2)) + [0, 0.1]
        driven = tuple((j, float(rng.choice([1.0, -0.5, 2.3])), float(rng.choice([0.0, 0.4]))) for j in range(count) if owners[j] == k)
        limits |= {j: np.sort(scale * np.array([low, high]) + shift) for j, scale, shift in driven}
        home = float(rng.uniform(low, high))
        motors.append(Motor(f"m{k}", "one" if k < 1 else "two", np.array([low, high]), home, driven, 1.5, 7.0, 3.0))
    joints = tuple(
        Joint(f"j{j}", parents[j], "prismatic" if rng.random() < 0.3 else "revolute", axes[j], rng.normal(size=3), limits[j])
        for j in range(count)
    )
    parts = {"one": Part("one", ("m0",), 0)}
    if len(motors) > 1:
        parts["two"] = Part("two", tuple(motor.name for motor in motors[1:]), 1)
    upside_down = np.array([[1.0, 0, 0], [0, -np.cos(tilt), -np.sin(tilt)], [0, np.sin(tilt), -np.cos(tilt)]])
    kinds = {"sphere": (0.1,), "capsule": (0.1, 0.3), "cylinder": (0.1, 0.3), "box": (0.1, 0.2, 0.3), "convex": ()}
    shapes = []
    for k in range(count + 1):
        for kind, size in kinds.items():
            rotation = upside_down if rng.random() < 0.5 else turned(seed + k)
            corners = rng.normal(size=(8, 3))
            vertices = corners / np.linalg.norm(corners, axis=1)[:, None] if kind == "convex" else None
            role = "field" if rng.random() < 0.4 else "solid"
            part = str(rng.choice(list(parts)))
            name = f"s{k}_{kind}"
            shapes.append(Shape(name, k, kind, size, rng.normal(size=3), rotation, role, part, vertices))
    pairs = {}
    for role in ("solid", "field"):
        chosen = [k for k, shape in enumerate(shapes) if shape.role == role]
        apart = [(a, b) for a in chosen for b in chosen if a < b and shapes[a].link != shapes[b].link]
        kept = [pair for pair in apart if rng.random() < 0.7]
        pairs[role] = np.array(kept, dtype=np.intp).reshape(-1, 2)
    tested = {frozenset((shapes[a].link, shapes[b].link)) for table in pairs.values() for a, b in table.tolist()}
    links = tuple(f"l{k}" for k in range(count + 1))
    every = [frozenset((a, b)) for a in range(count + 1) for b in range(a)]
    untested = {pair: f"reason <{k}>" for k, pair in enumerate(every) if pair not in tested}
    normal = rng.normal(size=3)
    marker = Marker("m", int(rng.integers(count + 1)), rng.normal(size=3), turned(seed + 99), normal / np.linalg.norm(normal))
    return Robot(
        "any", links, joints, tuple(motors), parts, {"m": marker}, tuple(shapes), (), pairs["field"], pairs["solid"],
        frozenset(k for k in range(len(shapes)) if rng.random() < 0.3), untested, {}, random_bodies(rng, count + 1),
    )  # fmt: skip


def random_bodies(rng: np.random.Generator, links: int) -> tuple[Body, ...]:
    """Masses of some of the links, of some with moments of inertia: those of a cloud of points."""
    bodies = []
    for link in range(links):
        mass, cloud = float(rng.uniform(0.1, 5.0)), rng.normal(size=(6, 3))
        inertia = (cloud**2).sum() * np.eye(3) - cloud.T @ cloud if rng.random() < 0.5 else None
        if rng.random() < 0.7:
            bodies.append(Body(link, mass, rng.normal(size=3), inertia))
    return tuple(bodies)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 2**32 - 200), st.sampled_from([0.0, 1e-9, 1e-6, 1e-3, 1.0]))
def test_any_robot_is_read_back_as_it_was(tmp_path: Path, seed: int, tilt: float) -> None:
    robot = random_robot(seed, tilt)
    assert_same_robot(robot, read_back(robot, tmp_path))


def test_a_joint_of_two_motors_or_of_none_is_refused_with_a_remedy(tmp_path: Path) -> None:
    robot = load_robot("katana")
    first, second, *others = robot.motor_table
    both = replace(robot, motor_table=(first, replace(second, joints=(*second.joints, first.joints[0])), *others))
    with pytest.raises(InvalidValue, match="joint 'arm_0' is driven by 'arm_0' and 'arm_1'. Make two joints of it, on the same axis"):
        write_xml(both, tmp_path / "x.xml")
    idle = replace(robot, motor_table=(replace(first, joints=()), second, *others))
    with pytest.raises(InvalidValue, match="joint 'arm_0' is driven by no motor. Give it one"):
        write_xml(idle, tmp_path / "x.xml")


def chain(count: int) -> Robot:
    """Links one after the other, each with its motor."""
    joints = tuple(
        Joint(f"j{k}", k, "revolute", np.array([0, 0, 1.0]), np.array([k + 1.0, 0, 0]), np.array([-1.0, 1])) for k in range(count)
    )
    motors = tuple(Motor(f"m{k}", "all", np.array([-1.0, 1]), 0.0, ((k, 1.0, 0.0),)) for k in range(count))
    nothing = np.empty((0, 2), dtype=np.intp)
    links = tuple(f"l{k}" for k in range(count + 1))
    return Robot("snake", links, joints, motors, {"all": Part("all", tuple(m.name for m in motors), 0)}, {}, (), (), nothing, nothing)


def test_a_chain_of_500_joints_is_written_and_read_again(tmp_path: Path) -> None:
    snake = chain(500)
    again = load_robot(write_xml(snake, tmp_path / "x.xml"))
    assert again.motors == snake.motors
    np.testing.assert_allclose([joint.point for joint in again.joints], [joint.point for joint in snake.joints])


def test_a_tree_too_deep_for_a_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidValue, match="is too deep in the tree: a file holds 2000 elements inside each other"):
        write_xml(chain(1100), tmp_path / "x.xml")


def test_a_slide_is_written_in_metres(tmp_path: Path) -> None:
    urdf = tmp_path / "gripper.urdf"
    urdf.write_text(
        '<robot name="gripper"><link name="palm"/><link name="finger"/><joint name="slide" type="prismatic"><parent link="palm"/>'
        '<child link="finger"/><axis xyz="1 0 0"/><limit lower="0.01" upper="0.04" effort="1" velocity="0.2"/></joint></robot>'
    )
    robot = load_robot(urdf)
    text = write_xml(robot, tmp_path / "gripper.xml").read_text()
    assert 'unit="m" minPos="0.01" maxPos="0.04"' in text
    assert 'velocity="0.2"' in text
    again = load_robot(tmp_path / "gripper.xml")
    assert again.limits.tolist() == robot.limits.tolist() == [[0.01, 0.04]]
    assert again.motor_table[0].joints == robot.motor_table[0].joints
    assert again.motor_table[0].max_velocity == 0.2


@pytest.mark.parametrize("names", [("pan", "slide"), ("1", "0"), ("7", "left slide"), ("a,b", "-1")])
def test_constraints_are_read_back_with_motors_in_metres_and_names_that_are_no_words(tmp_path: Path, names: tuple[str, str]) -> None:
    path = robot_file(
        tmp_path,
        f'<bodypart name="lift"><motor name="{names[0]}" minPos="-90" maxPos="90"><joint name="a" z="1"/></motor>',
        f'<motor name="{names[1]}" unit="m" minPos="0" maxPos="0.2"><joint name="b" type="prismatic" z="1"/></motor><constraintList>',
        '<constraint a="2" q="0" b="30"/><constraint a="-1" q="1" b="0.15"/><constraint a="-1 -100" q="0 1" b="20"/></constraintList>',
        "</bodypart>",
    )
    robot = load_robot(path)
    (clause,), (again,) = robot.clauses, read_back(robot, tmp_path).clauses
    assert np.abs(clause.a - again.a).max() < 1e-12
    assert np.abs(clause.b - again.b).max() < 1e-12


def test_shapes_outside_of_every_part_remain_there(tmp_path: Path) -> None:
    robot = load_robot(arm_on_a_pillar(tmp_path))
    assert robot.shapes[0].part == ""
    assert len(robot.field_pairs) == 1
    assert_same_robot(robot, read_back(robot, tmp_path))


def test_an_unknown_unit_of_a_motor_is_refused(tmp_path: Path) -> None:
    text = write_xml(load_robot("katana"), tmp_path / "katana.xml").read_text()
    (tmp_path / "katana.xml").write_text(text.replace("<motor ", '<motor unit="rad" ', 1))
    with pytest.raises(RobotFileError, match="unknown unit 'rad'.*Valid: deg, m"):
        load_robot(tmp_path / "katana.xml")
