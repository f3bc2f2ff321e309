# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mobee import Model
from mobee.model import World, box, cylinder, sphere
from mobee.model.kinematics import link_transforms
from mobee.model.masses import gravity_torque
from mobee.model.world_file import load_world
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.simulation.motors import MotorParameters
from tests.services.robots import chain

mujoco = pytest.importorskip("mujoco")
from services.robot_sim.mujoco_backend import MujocoBackend  # noqa: E402  # only where MuJoCo is
from services.robot_sim.mujoco_scene import MujocoScene  # noqa: E402  # only where MuJoCo is

DT = 0.01
GRIPPER = """\
<robot name="gripper"><link name="base"><inertial><mass value="1"/></inertial></link>
 <link name="slide"><inertial><mass value="0.5"/><inertia ixx="0.01" iyy="0.01" izz="0.03" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.04 0.04 0.2"/></geometry></collision></link>
 <link name="left"><inertial><mass value="0.1"/></inertial>
  <collision><origin xyz="0 0.03 0.05"/><geometry><sphere radius="0.01"/></geometry></collision></link>
 <link name="right"><collision><origin xyz="0 -0.03 0.05"/><geometry><sphere radius="0.01"/></geometry></collision></link>
 <joint name="lift" type="prismatic"><parent link="base"/><child link="slide"/><origin xyz="0 0 0.5" rpy="0.3 0.2 0"/><axis xyz="0 0 1"/>
  <limit lower="0" upper="0.4" velocity="0.5" effort="50"/></joint>
 <joint name="left" type="revolute"><parent link="slide"/><child link="left"/><origin xyz="0 0.02 0.1"/><axis xyz="1 0 0"/>
  <limit lower="-0.5" upper="0.5" velocity="1" effort="5"/></joint>
 <joint name="right" type="revolute"><parent link="slide"/><child link="right"/><origin xyz="0 -0.02 0.1"/><axis xyz="1 0 0"/>
  <limit lower="-0.6" upper="0.4" velocity="1" effort="5"/><mimic joint="left" multiplier="-1" offset="-0.1"/></joint>
</robot>
"""


def written(tmp_path: Path, text: str) -> Robot:
    (tmp_path / "robot.urdf").write_text(text)
    return load_robot(tmp_path / "robot.urdf")


def body(robot: Robot, parameters: MotorParameters | None = None) -> MujocoBackend:
    return MujocoBackend(robot, World, parameters or MotorParameters(encoder_noise=0.0), seed=0, dt=DT)


@pytest.mark.parametrize("name", ["icub", "icub_2014", "katana", "gripper"])
def test_links_are_where_the_model_says(tmp_path: Path, rng: np.random.Generator, name: str) -> None:
    robot = written(tmp_path, GRIPPER) if name == "gripper" else load_robot(name)
    scene = MujocoScene(robot, World(), 0.005)
    frames = np.tile(np.eye(4), (len(robot.links), 1, 1))
    frames[1:, :3, 3] = [joint.point for joint in robot.joints]
    for _ in range(50):
        q = rng.uniform(*robot.limits.T)
        scene.set_posture(q)
        expected = link_transforms(robot, q) @ frames
        for link in range(len(robot.links)):
            found = scene.data.body(f"link{link}")
            np.testing.assert_allclose(found.xpos, expected[link, :3, 3], atol=1e-9)
            np.testing.assert_allclose(found.xmat.reshape(3, 3), expected[link, :3, :3], atol=1e-9)
        np.testing.assert_allclose(scene.motor_positions(), q, atol=1e-12)


def test_it_weighs_what_the_model_says(rng: np.random.Generator) -> None:
    robot = load_robot("icub")
    scene = MujocoScene(robot, World(), 0.005)
    for _ in range(20):
        q = rng.uniform(*robot.limits.T)
        scene.set_posture(q)
        np.testing.assert_allclose(scene.data.qfrc_bias[scene.dofs] * scene.scale, gravity_torque(robot, q), atol=1e-3)


def test_it_touches_where_the_model_says(rng: np.random.Generator) -> None:
    robot, world = load_robot("icub"), load_world("table")
    scene, model = MujocoScene(robot, world, 0.005), Model(robot, world)
    touching = 0
    for _ in range(30):
        q = rng.uniform(*robot.limits.T)
        scene.set_posture(q)
        links = [*robot.links, "table"]
        expected = {
            tuple(sorted((links[one.first_link], one.second if one.second_link < 0 else links[one.second_link]))): one.depth
            for one in sorted(model.evaluate(q).contacts, key=lambda one: one.depth)
            if one.kind == "solid"
        }
        deep = {pair for pair, depth in expected.items() if depth > 1e-5}
        found = scene.contacts()
        assert deep <= found.keys() <= expected.keys()
        touching += len(deep)
    assert touching > 30


@pytest.mark.parametrize("weighed", [True, False])
def test_every_motor_of_any_robot_holds_and_follows(tmp_path: Path, weighed: bool) -> None:
    robot = written(tmp_path, GRIPPER if weighed else chain(4))
    backend = body(robot, MotorParameters.ideal())
    assert bool(backend.notes) != weighed
    start = backend.motors.q
    for _ in range(200):
        backend.step(DT)
    np.testing.assert_allclose(backend.motors.q, start, atol=1e-4)
    wanted = robot.limits.mean(axis=1) + 0.2 * (robot.limits[:, 1] - robot.limits[:, 0])
    for _ in range(400):
        backend.motors.command(slice(None), "position", wanted)
        backend.step(DT)
    np.testing.assert_allclose(backend.motors.q, wanted, atol=1e-3)
    angles = backend._scene.data.qpos[backend._scene._all_qpos]
    matrix, offset = robot.coupling
    np.testing.assert_allclose(angles, matrix @ backend.motors.q + offset, atol=1e-4)


def test_a_motor_that_is_too_weak_sinks_under_the_weight(tmp_path: Path) -> None:
    robot = written(tmp_path, GRIPPER)
    weak = replace(robot, motor_table=(replace(robot.motor_table[0], max_torque=3.0, home=0.3), *robot.motor_table[1:]))
    backend = body(weak)
    for _ in range(300):
        backend.step(DT)
    assert backend.motors.q[0] == pytest.approx(robot.limits[0, 0], abs=1e-3)  # 0.6 kg weigh more than 3 N, down to the stop
    assert backend.motors.efforts[0] == pytest.approx(3.0)


def test_pairs_that_overlap_at_home_are_not_tested_and_reported(tmp_path: Path) -> None:
    text = GRIPPER.replace('xyz="0 -0.03 0.05"', 'xyz="0 0.05 0.05"')  # the right finger's ball in the left one's
    backend = body(written(tmp_path, text))
    assert "overlap at home and are not tested" in backend.notes[0]
    for _ in range(100):
        backend.step(DT)
    assert backend.contact().depth == 0.0


def test_a_link_whose_solid_is_tiny_has_a_mass(tmp_path: Path) -> None:
    text = chain(2).replace("radius='0.02' length='0.1'", "radius='1e-6' length='1e-6'")
    backend = body(written(tmp_path, text))
    for _ in range(50):
        backend.step(DT)
    assert np.isfinite(backend.motors.q).all()


def test_a_ghost_is_passed_through_and_a_ball_is_not(tmp_path: Path) -> None:
    robot = written(tmp_path, GRIPPER)
    ends = []
    for role in ("ghost", "target"):
        world = World()
        world.add("ball", sphere(0.03), position=robot.shapes[0].position + 0.3 * robot.joints[0].axis, role=role)
        backend = MujocoBackend(robot, lambda world=world: world, MotorParameters(), seed=0, dt=DT)
        backend.motors.command(slice(0, 1), "velocity", np.array([0.2]))
        for _ in range(150):
            backend.step(DT)
        ends.append(backend.motors.q[0])
    assert ends[0] > 0.25
    assert ends[1] == pytest.approx(0.3 - 0.1 - 0.03, abs=2e-3)  # the slide is 0.1 m long above its origin


PUSHER = """\
<robot name="pusher"><link name="base"><inertial><mass value="1"/></inertial></link>
 <link name="finger"><inertial><mass value="0.2"/></inertial>
  <collision><origin xyz="0 0 {height}"/><geometry><sphere radius="0.008"/></geometry></collision></link>
 <joint name="slide" type="prismatic"><parent link="base"/><child link="finger"/><origin xyz="0 0 0"/><axis xyz="1 0 0"/>
  <limit lower="0" upper="0.3" velocity="0.5" effort="50"/></joint>
</robot>
"""


def table_with_cup() -> World:
    world = World()
    world.add("table", box(2.0, 2.0, 0.2), position=(0.0, 0.0, -0.1))
    world.add("cup", cylinder(0.03, 0.11), position=(0.1, 0.0, 0.055), role="target", mass=0.15, friction=0.4)
    world.add("crate", box(0.08, 0.08, 0.08), position=(0.28, 0.0, 0.04), mass=0.3)
    return world


@pytest.mark.parametrize(("height", "upright"), [(0.02, True), (0.1, False)])
def test_a_movable_cup_is_pushed_when_touched_low_and_falls_when_touched_high(tmp_path: Path, height: float, upright: bool) -> None:
    backend = MujocoBackend(written(tmp_path, PUSHER.format(height=height)), table_with_cup, MotorParameters.ideal(), seed=0, dt=DT)
    for _ in range(50):
        backend.step(DT)
    cup = backend.world.objects["cup"]
    np.testing.assert_allclose(cup.position, (0.1, 0.0, 0.055), atol=5e-4)  # it rests
    backend.motors.command(slice(0, 1), "velocity", np.array([0.1]))
    for _ in range(120):
        backend.step(DT)
    backend.motors.command(slice(0, 1), "velocity", np.array([0.0]))
    for _ in range(50):
        backend.step(DT)
    cup = backend.world.objects["cup"]
    assert (cup.rotation[2, 2] > 0.99) == upright
    if upright:
        assert cup.position[0] == pytest.approx(backend.motors.q[0] + 0.008 + 0.03, abs=2e-3)  # in front of the finger
        assert "crate" not in backend.contact().pair  # only contacts of the robot count
    backend.place("cup", (0.0, 0.5, 0.06))
    for _ in range(50):
        backend.step(DT)
    cup = backend.world.objects["cup"]
    np.testing.assert_allclose(cup.position, (0.0, 0.5, 0.055), atol=5e-4)
    assert cup.rotation[2, 2] > 0.999


def test_things_that_are_pushed_push_others(tmp_path: Path) -> None:
    backend = MujocoBackend(written(tmp_path, PUSHER.format(height=0.02)), table_with_cup, MotorParameters.ideal(), seed=0, dt=DT)
    backend.motors.command(slice(0, 1), "velocity", np.array([0.1]))
    for _ in range(300):
        backend.step(DT)
    cup, crate = (backend.world.objects[name].position for name in ("cup", "crate"))
    assert crate[0] > 0.3
    assert crate[0] - cup[0] == pytest.approx(0.07, abs=5e-3)
